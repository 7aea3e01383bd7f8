// The engine around crowd.h. Figures appear, disappear, teleport and leave the view while frames
// are in flight. Each figure consists of all skinned meshes of the model, and has its own clip and
// phase.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "crowd.h"
#include "crowd_check.h"
#include "crowd_report.h"
#include "drill.h"
#include "film.h"
#include "frames.h"
#include "gait.h"
#include "kit/batch_runner.h"
#include "kit/driver_version.h"
#include "kit/open_device.h"
#include "kit/program.h"
#include "kit/render/picture_writer.h"
#include "kit/timestamps.h"
#include "options.h"
#include "shown_poses.h"
#include "stroll.h"

namespace {

using namespace dermis;
using namespace crowd;
using samples::ExitStatus;
using samples::reportDeviceError;
using samples::reportError;

/// The loop is the last member, so it is destroyed first: its destructor waits for frames that use
/// the others.
struct Show {
  Crowd crowd;
  ShownPoses shown;
  CrowdCheck check;
  CrowdReport report;
  std::unique_ptr<Film> film;  ///< null: there is none
  FrameLoop loop;
};

Result<void> playFrame(Show& show, const Options& options) {
  const Result<VkCommandBuffer> commandBuffer = show.loop.begin();
  if (!commandBuffer) return commandBuffer.error();
  const std::uint64_t frame = show.loop.frame();
  if (Result<void> done = show.check.compareUpTo(show.loop.completed()); !done) return done;
  if (Result<void> done = show.crowd.skinFrame(frame, show.loop.completed(), *commandBuffer); !done)
    return done;
  show.shown.follow(show.crowd, frame);
  show.report.add(show.crowd, show.shown.counts());
  if (show.film != nullptr) {
    if (Result<void> done = show.film->writeUpTo(show.loop.completed(), show.report); !done)
      return done;
    if (Result<void> done = show.film->record(show.crowd, frame, *commandBuffer); !done)
      return done;
  }
  if (options.verifies && (frame % options.checkInterval == 0 || frame == options.frames)) {
    if (Result<void> done = show.check.capture(show.crowd, show.shown, frame, *commandBuffer);
        !done)
      return done;
  }
  if (Result<void> done = show.loop.submit(); !done) return done;
  return show.film != nullptr ? show.film->watch(show.loop.fence()) : Result<void>();
}

/// Writes the pictures that were in flight when the last frame was submitted.
Result<void> finishFilm(Show& show, const Options& options) {
  const std::uint64_t last = show.loop.frame(), inFlight = options.crowd.framesInFlight;
  for (std::uint64_t ahead = inFlight; ahead-- > 0;) {
    if (ahead >= last) continue;
    const std::uint64_t completed = last - ahead;
    if (Result<void> done = show.crowd.complete(completed + inFlight, completed); !done)
      return done;
    show.report.addCompleted(show.crowd);
    if (Result<void> done = show.film->writeUpTo(completed, show.report); !done) return done;
  }
  return show.film->finish();
}

Result<void> play(Show& show, const Options& options) {
  if (show.film != nullptr)
    show.report.printLater();
  else
    show.report.printTitle();
  for (std::uint32_t frame = 0; frame < options.frames; ++frame) {
    if (Result<void> done = playFrame(show, options); !done) return done;
  }
  if (Result<void> done = show.loop.finish(); !done) return done;
  if (Result<void> done = show.check.compareUpTo(show.loop.completed()); !done) return done;
  if (show.film != nullptr) {
    if (Result<void> done = finishFilm(show, options); !done) return done;
  }
  show.report.finish(show.crowd);
  return {};
}

ReportTitle titleOf(const Character& character, const Options& options) {
  ReportTitle title;
  title.model = std::filesystem::path(options.model).filename().string();
  title.meshes = character.parts().size();
  title.verticesOfFigure = character.vertexCount();
  title.framesInFlight = options.crowd.framesInFlight;
  title.culledOnGpu = options.crowd.culledOnGpu;
  return title;
}

Result<std::unique_ptr<Show>> makeShow(samples::OpenDevice& open, const Character& character,
                                       const Figures& script, const Options& options) {
  CrowdOptions crowdOptions = options.crowd;
  const Result<samples::Timestamps> timestamps = samples::Timestamps::create(*open.device);
  if (!timestamps) return timestamps.error();
  crowdOptions.measuresGpuTime = timestamps->has();
  Result<Crowd> crowd = Crowd::create(*open.device, open.context, character, script, crowdOptions);
  if (!crowd) return crowd.error();
  Result<FrameLoop> loop = FrameLoop::create(*open.device, options.crowd.framesInFlight);
  if (!loop) return loop.error();
  ReportTitle title = titleOf(character, options);
  title.device = open.device->info().name;
  title.driver = samples::driverVersion(*open.device);
  return std::make_unique<Show>(Show{std::move(*crowd), ShownPoses(character),
                                     CrowdCheck(open.device.get(), character),
                                     CrowdReport(std::move(title)), nullptr, std::move(*loop)});
}

/// What is wrong with the result; empty if nothing is.
std::string verdict(const CrowdCheck& check, const ShownPoses& shown) {
  const CheckTotals& totals = check.totals();
  if (totals.failures != 0) {
    return fmt::format("{} of {} instances are wrong; the first: {}", totals.failures,
                       totals.instances, totals.firstFailure);
  }
  if (shown.overdue() != 0) {
    return fmt::format("{} times an instance was due but was not skinned", shown.overdue());
  }
  return {};
}

/// Ticks are the frames of the film, so that feet do not slide on the ground.
CharacterOptions characterOptions(const Options& options) {
  CharacterOptions character;
  if (options.film.output.empty()) return character;
  constexpr double mostSeconds = 20;
  character.ticksPerSecond = options.film.framesPerSecond;
  character.mostTicks = static_cast<std::uint32_t>(mostSeconds * character.ticksPerSecond);
  character.images = true;
  return character;
}

/// What the figures do: a drill for the check, or a stroll for the film.
struct Script {
  Gait gait;
  std::unique_ptr<Figures> figures;
  const Stroll* stroll = nullptr;  ///< `figures`, if there is a film
};

Result<std::unique_ptr<Script>> makeScript(const Character& character, const Options& options) {
  auto script = std::make_unique<Script>();
  if (options.film.output.empty()) {
    script->figures = std::make_unique<Drill>(character, options.figures);
    return script;
  }
  Result<Gait> gait = measureGait(character);
  if (!gait) return gait.error();
  script->gait = std::move(*gait);
  StrollOptions stroll;
  stroll.figures = options.figures;
  stroll.framesPerSecond = options.film.framesPerSecond;
  stroll.start = options.film.start;
  stroll.width = options.film.width;
  stroll.height = options.film.height;
  auto strolling = std::make_unique<Stroll>(character, script->gait, stroll);
  script->stroll = strolling.get();
  script->figures = std::move(strolling);
  return script;
}

Result<std::unique_ptr<samples::PictureWriter>> openWriter(const FilmRequest& film) {
  const samples::PictureKind kind = *samples::pictureKind(film.output);
  if (kind == samples::PictureKind::png) return samples::writePngs(film.output);
  return samples::writeFilm(film.output, kind, film.width, film.height, film.framesPerSecond);
}

ExitStatus addFilm(Show& show, samples::OpenDevice& open, const Character& character,
                   const Stroll& stroll, const Options& options) {
  Result<std::unique_ptr<samples::PictureWriter>> writer = openWriter(options.film);
  if (!writer) return reportError(ExitStatus::stopped, writer.error().message);
  const FilmOptions filmOptions{options.film.width, options.film.height, options.frames,
                                options.crowd.framesInFlight};
  Result<std::unique_ptr<Film>> film =
      Film::create(open, character, stroll, filmOptions, std::move(*writer));
  if (!film) return reportDeviceError(film.error());
  show.film = std::move(*film);
  return ExitStatus::done;
}

/// Reports the result of the check, as text and in a file. `complaint` is empty if there is no
/// error.
ExitStatus reportOn(const CrowdReport& report, const CheckTotals& check, const Options& options,
                    const std::string& complaint) {
  const CheckTotals* totals = options.verifies ? &check : nullptr;
  if (totals != nullptr) report.printCheck(*totals);
  if (!options.json.empty()) {
    if (Result<void> written = report.writeJson(options.json, totals); !written)
      return reportError(ExitStatus::stopped, written.error().message);
  }
  return complaint.empty() ? ExitStatus::done
                           : reportError(ExitStatus::verificationFailed, complaint);
}

/// Runs the whole program without Vulkan.
ExitStatus runOnCpu(const Character& character, const Figures& script, const Options& options) {
  Result<Crowd> crowd = Crowd::createOnCpu(character, script, options.crowd);
  if (!crowd) return reportDeviceError(crowd.error());
  ReportTitle title = titleOf(character, options);
  title.device = samples::CpuTarget().name();
  title.isOnCpu = true;
  ShownPoses shown(character);
  CrowdCheck check(nullptr, character);
  CrowdReport report(std::move(title));
  report.printTitle();
  const auto play = [&](std::uint64_t frame) -> Result<void> {
    if (Result<void> done = crowd->skinOnCpu(frame); !done) return done;
    shown.follow(*crowd, frame);
    report.add(*crowd, shown.counts());
    if (!options.verifies || (frame % options.checkInterval != 0 && frame != options.frames))
      return {};
    if (Result<void> done = check.captureOnCpu(*crowd, shown, frame); !done) return done;
    return check.compareUpTo(frame);
  };
  for (std::uint64_t frame = 1; frame <= options.frames; ++frame) {
    if (Result<void> played = play(frame); !played) return reportDeviceError(played.error());
  }
  report.finish(*crowd);
  return reportOn(report, check.totals(), options, verdict(check, shown));
}

ExitStatus run(const Options& options) {
  const bool isFilm = !options.film.output.empty() &&
                      samples::pictureKind(options.film.output) != samples::PictureKind::png;
  if (isFilm) {
    if (Result<void> program = samples::checkFilmProgram(options.film.output); !program)
      return reportError(ExitStatus::stopped, program.error().message);
  }
  const Result<Character> character = Character::load(options.model, characterOptions(options));
  if (!character) return reportError(ExitStatus::badInput, character.error().message);
  if (Result<void> kept = checkOutputFiles(options, character->model().sideFiles); !kept)
    return samples::reportWrongUsage(kept.error().message);
  const Result<std::unique_ptr<Script>> script = makeScript(*character, options);
  if (!script) return reportError(ExitStatus::badInput, script.error().message);
  if (options.device == "cpu") return runOnCpu(*character, *(*script)->figures, options);
  samples::DeviceOptions deviceOptions;
  deviceOptions.device = options.device;
  deviceOptions.validation = options.validates;
  deviceOptions.graphics = (*script)->stroll != nullptr;
  Result<samples::OpenDevice> open = samples::openDevice(deviceOptions);
  if (!open) return reportDeviceError(open.error());

  Result<std::unique_ptr<Show>> show = makeShow(*open, *character, *(*script)->figures, options);
  if (!show) return reportDeviceError(show.error());
  if ((*script)->stroll != nullptr) {
    const ExitStatus added = addFilm(**show, *open, *character, *(*script)->stroll, options);
    if (added != ExitStatus::done) return added;
  }
  if (Result<void> played = play(**show, options); !played)
    return reportDeviceError(played.error());

  const std::vector<std::string> messages = open->device->takeValidationMessages();
  const std::string complaint = !messages.empty() ? "the validation layer says: " + messages.front()
                                                  : verdict((*show)->check, (*show)->shown);
  return reportOn((*show)->report, (*show)->check.totals(), options, complaint);
}

ExitStatus run(int argc, char** argv) {
  Options options;
  const std::optional<ExitStatus> ended = readOptions(argc, argv, options);
  return ended ? *ended : run(options);
}

}  // namespace

int main(int argc, char** argv) {
  return samples::runProgram("dermis_crowd", argc, argv, run);
}
