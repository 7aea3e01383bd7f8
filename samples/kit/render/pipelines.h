// The pipelines of the renderer, created when they are first needed.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <tuple>

#include "kit/render/draw.h"
#include "kit/render/owned.h"

namespace dermis::samples::render {

enum class Step : std::uint8_t { shadow, background, ground, mesh };

/// Identifies a pipeline. For a background or ground, only the step matters.
struct PipelineKey {
  Step step = Step::mesh;
  VertexFormat positions = VertexFormat::none, normals = VertexFormat::none;
  std::uint32_t positionStride = 0, normalStride = 0, valueStride = 0;
  Transparency transparency = Transparency::opaque;
  bool isDoubleSided = false;
  bool isMirrored = false;

  auto tied() const {
    return std::tie(step, positions, normals, positionStride, normalStride, valueStride,
                    transparency, isDoubleSided, isMirrored);
  }
  bool operator<(const PipelineKey& other) const { return tied() < other.tied(); }
};

/// Number of filter samples for shadows; specializes the fragment shaders.
struct FilterTaps {
  std::int32_t blockers = 20, penumbra = 32, sky = 4;
};

class Pipelines {
 public:
  /// The passes must outlive it.
  static Result<Pipelines> create(const Device& device, VkRenderPass shadowPass,
                                  VkRenderPass picturePass, const FilterTaps& taps);

  /// Fails with `invalidArgument` for formats that cannot be drawn.
  Result<VkPipeline> get(const Device& device, const PipelineKey& key);

  VkPipelineLayout layout() const { return layout_.get(); }
  VkDescriptorSetLayout viewLayout() const { return viewLayout_.get(); }
  VkDescriptorSetLayout textureLayout() const { return textureLayout_.get(); }

 private:
  Result<void> makeLayouts(const Device& device);
  Result<void> loadShaders(const Device& device);
  Result<Owned<VkPipeline>> build(const Device& device, const PipelineKey& key) const;

  VkRenderPass shadowPass_ = VK_NULL_HANDLE, picturePass_ = VK_NULL_HANDLE;
  FilterTaps taps_;
  Owned<VkDescriptorSetLayout> viewLayout_, textureLayout_;
  Owned<VkPipelineLayout> layout_;
  Owned<VkShaderModule> shadowVertex_, shadowFragment_, meshVertex_, meshFragment_,
      backgroundVertex_, backgroundFragment_, groundVertex_, groundFragment_;
  std::map<PipelineKey, Owned<VkPipeline>> pipelines_;
};

}  // namespace dermis::samples::render
