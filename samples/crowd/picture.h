// A picture of the crowd: all figures by one indirect draw, straight from the output of the scene.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "dermis/layout.h"
#include "dermis/scene.h"
#include "kit/buffer.h"
#include "kit/character.h"
#include "kit/render/owned.h"
#include "kit/render/picture.h"
#include "kit/render/target.h"

namespace crowd {

/// One part of a figure to draw.
struct Drawn {
  dermis::InstanceHandle instance;
  std::uint32_t part = 0;
  dermis::JointMatrix place;  ///< of its figure in the world
  glm::vec3 color;
};

class Painter {
 public:
  /// `meshes`: of each part of the character. The layout has float32x3 positions and octahedral16x2
  /// normals. `drawsOneByOne`: as for a device that lacks a feature for indirect draws. Throws
  /// `samples::Failure`.
  Painter(dermis::samples::Device& device, const dermis::samples::Character& character,
          std::span<const dermis::MeshHandle> meshes, const dermis::VertexLayout& layout,
          bool drawsOneByOne);

  /// Draws into the picture, after the barrier to vertex input.
  void record(VkCommandBuffer commandBuffer, const dermis::Scene& scene, VkBuffer vertices,
              std::span<const Drawn> figures, const glm::mat4& viewProjection);
  /// Once the GPU has completed it.
  dermis::samples::render::Picture picture() const;

 private:
  void makeSet();
  void makePipeline(const dermis::VertexLayout& layout);
  void draw(VkCommandBuffer commandBuffer) const;

  dermis::samples::Device* device_;
  bool drawsOneByOne_;
  dermis::samples::render::Owned<VkRenderPass> pass_;
  dermis::samples::render::RenderTarget target_;
  dermis::samples::render::Owned<VkDescriptorSetLayout> setLayout_;
  dermis::samples::render::Owned<VkPipelineLayout> layout_;
  dermis::samples::render::Owned<VkPipeline> pipeline_;
  dermis::samples::render::Owned<VkDescriptorPool> pool_;
  VkDescriptorSet set_ = VK_NULL_HANDLE;
  std::vector<dermis::IndexRange> indexRanges_;  ///< by mesh
  std::vector<std::uint32_t> firstTexcoords_;    ///< by part
  std::vector<dermis::IndexedDraw> draws_;
  dermis::samples::MappedBuffer indices_, texcoords_, figures_, arguments_;
};

/// The view of somebody who stands at `eye` and looks along `direction`.
glm::mat4 viewProjection(const glm::vec3& eye, const glm::vec3& direction);

}  // namespace crowd
