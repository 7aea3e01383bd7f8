// Draws pictures of the crowd from the output buffer, in the command buffer that skinned it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "crowd.h"
#include "crowd_report.h"
#include "kit/open_device.h"
#include "kit/progress.h"
#include "kit/render/appearances.h"
#include "kit/render/pass_counter.h"
#include "kit/render/picture_writer.h"
#include "kit/render/renderer.h"
#include "statistics_panel.h"
#include "stroll.h"
#include "wardrobe.h"

namespace crowd {

struct FilmOptions {
  std::uint32_t width = 1280, height = 720;
  std::uint32_t frames = 1;
  std::uint32_t framesInFlight = 3;
};

class Film {
 public:
  /// `device` must support graphics. `device`, `character` and `stroll` must outlive the film.
  static dermis::Result<std::unique_ptr<Film>> create(
      dermis::samples::OpenDevice& device, const Character& character, const Stroll& stroll,
      const FilmOptions& options, std::unique_ptr<dermis::samples::PictureWriter> writer);

  /// Records the picture, after `Crowd::skinFrame`.
  dermis::Result<void> record(const Crowd& crowd, std::uint64_t frame,
                              VkCommandBuffer commandBuffer);
  /// Shows the progress of a single picture until its submission is complete. For a film it returns
  /// at once, since a film counts pictures.
  dermis::Result<void> watch(VkFence submission);
  /// Writes the pictures up to a frame that the GPU has completed and the report has counted. Call
  /// it before the next `record`.
  dermis::Result<void> writeUpTo(std::uint64_t completedFrame, const CrowdReport& report);
  /// After the last picture.
  dermis::Result<void> finish();

 private:
  Film(dermis::samples::OpenDevice& device, const Character& character, const Stroll& stroll,
       const FilmOptions& options, std::unique_ptr<dermis::samples::PictureWriter> writer,
       dermis::samples::render::Renderer renderer)
      : device_(&device),
        character_(&character),
        stroll_(&stroll),
        options_(options),
        writer_(std::move(writer)),
        wardrobe_(character),
        renderer_(std::move(renderer)),
        appearances_(*device.device, renderer_, character.model()) {}

  struct DrawnPart {
    const dermis::samples::render::Geometry* geometry = nullptr;
    /// Each with fewer triangles than the one before it.
    std::vector<dermis::samples::render::Geometry> coarse;
    dermis::samples::render::Surface surface;
  };
  /// A figure that the picture shows.
  struct Seen {
    double distance = 0;  ///< from the camera
    std::uint32_t figure = 0;
  };
  /// The draws of the picture and of the shadow maps.
  struct Draws {
    std::vector<dermis::samples::render::Draw> picture, shadows;
  };

  dermis::Result<void> prepareParts();
  dermis::Result<void> makeFrames();
  dermis::Result<void> makeProgress();
  void loadFont();
  dermis::samples::render::View viewAt(std::uint64_t frame) const;
  std::vector<Seen> nearestFirst(const Crowd& crowd, std::uint64_t frame) const;
  const dermis::samples::render::Geometry* geometryFor(const DrawnPart& part, double error) const;
  dermis::Result<Draws> drawsOf(const Crowd& crowd, std::uint64_t frame) const;
  PanelNumbers numbersOf(const CrowdReport& report, std::uint64_t frame) const;

  dermis::samples::OpenDevice* device_;
  const Character* character_;
  const Stroll* stroll_;
  FilmOptions options_;
  std::unique_ptr<dermis::samples::PictureWriter> writer_;
  Wardrobe wardrobe_;
  dermis::samples::render::Renderer renderer_;
  dermis::samples::Appearances appearances_;
  std::vector<DrawnPart> parts_;
  bool isMirrored_ = false;
  std::vector<dermis::samples::render::RenderFrame> frames_;  ///< one for each in flight
  std::uint64_t written_ = 0;                                 ///< the last frame that was written
  std::uint64_t recorded_ = 0;
  std::optional<StatisticsPanel> panel_;
  std::optional<dermis::samples::render::PassCounter> passes_;  ///< of the only picture
  std::optional<dermis::samples::Progress> progress_;           ///< until the film is finished
};

}  // namespace crowd
