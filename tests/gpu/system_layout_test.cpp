// Where a system puts the vertices of its instances: interleaved and planar, in every format, with
// room that is the engine's.

#include <gtest/gtest.h>

#include <algorithm>

#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::byte poison{0xa5};

VertexLayout layoutOf(VertexFormat positions, VertexFormat normals, VertexFormat tangents,
                      bool planar = false, std::uint32_t stride = 0) {
  VertexLayout layout{positions, normals, tangents};
  layout.motion = true;
  layout.planar = planar;
  layout.stride = stride;
  return layout;
}

/// One instance of each of three meshes, of an odd number of vertices among them, for every layout.
class SystemLayoutTest : public SystemTest {
 protected:
  void addInstances(SystemEngine& engine, const VertexLayout& layout) {
    InstanceDescription instance;
    instance.layout = layout;
    instance.box = {{-6, -6, -6}, {6, 6, 6}};
    for (std::uint32_t i = 0; i < 3; ++i) {
      instance.mesh = meshHandles_[i];
      instance.pose = palette_;
      instances_.push_back({engine.addInstance(instance), instance, i});
    }
  }
  void fillEngine(SystemEngine& engine, std::span<const VertexLayout> layouts) {
    engine.fillOutput(poison);
    engine.begin();
    palette_ = engine.addPose(pose_);
    for (const PackedMesh& mesh : meshes_) meshHandles_.push_back(engine.addMesh(mesh));
    for (const VertexLayout& layout : layouts) addInstances(engine, layout);
    engine.submit();
  }
  void expectPlace(const InstanceOutput& output, const VertexLayout& layout,
                   std::uint32_t vertexCount) const;
  /// Expects every attribute to be that of tier 1, and every other byte to be poison.
  void expectOutput(SystemEngine& engine);

  struct Placed {
    InstanceHandle handle;
    InstanceDescription description;
    std::uint32_t mesh;
  };
  std::vector<PackedMesh> meshes_{systemMesh(1, 33), systemMesh(2, 100), systemMesh(3, 7)};
  std::vector<MeshHandle> meshHandles_;
  Pose pose_ = systemPose(3);
  PoseHandle palette_;
  std::vector<Placed> instances_;
};

void SystemLayoutTest::expectPlace(const InstanceOutput& output, const VertexLayout& layout,
                                   std::uint32_t vertexCount) const {
  EXPECT_GT(output.places.size, 0u);
  EXPECT_EQ(output.places[Stream::positions].format, layout.positions);
  EXPECT_EQ(output.places[Stream::normals].format, layout.normals);
  EXPECT_EQ(output.places[Stream::tangents].format, layout.tangents);
  EXPECT_EQ(output.places[Stream::previousPositions].format,
            layout.motion ? layout.positions : VertexFormat::none);
  std::uint32_t used = 0;
  for (const OutputAttribute& attribute : output.places.attributes) {
    if (attribute.format == VertexFormat::none) continue;
    const std::uint32_t size = formatSize(attribute.format);
    EXPECT_GE(attribute.offset, output.offset);
    EXPECT_LE(attribute.offset + std::uint64_t{vertexCount - 1} * attribute.stride + size,
              output.offset + output.places.size);
    if (layout.planar) {
      EXPECT_EQ(attribute.offset % 16, 0u);
    } else {
      // One after the other, each where its components may stand.
      EXPECT_GE(attribute.offset, output.offset + used);
      EXPECT_LT(attribute.offset, output.offset + used + 4);
      used = static_cast<std::uint32_t>(attribute.offset - output.offset);
    }
    used += size;
  }
  if (!layout.planar) {
    const std::uint32_t stride = layout.stride != 0 ? layout.stride : (used + 3) / 4 * 4;
    for (const OutputAttribute& attribute : output.places.attributes) {
      EXPECT_TRUE(attribute.format == VertexFormat::none || attribute.stride == stride);
    }
    EXPECT_EQ(output.offset % stride, 0u);
  }
}

void SystemLayoutTest::expectOutput(SystemEngine& engine) {
  const std::vector<std::byte> bytes = engine.readOutput();
  std::vector<bool> written(bytes.size());
  for (const Placed& placed : instances_) {
    SCOPED_TRACE(placed.handle.index);
    const std::uint32_t vertexCount = meshes_[placed.mesh].vertexCount();
    const InstanceOutput output = must(engine->output(placed.handle));
    expectPlace(output, placed.description.layout, vertexCount);
    const Streams expected = alone(meshes_[placed.mesh], pose_, placed.description);
    EXPECT_TRUE(engine.read(bytes, placed.handle) == expected);
    for (const OutputAttribute& attribute : output.places.attributes) {
      for (std::size_t vertex = 0; vertex < vertexCount; ++vertex) {
        const std::size_t place = attribute.offset + vertex * attribute.stride;
        for (std::size_t byte = 0; byte < formatSize(attribute.format); ++byte) {
          EXPECT_FALSE(written[place + byte]) << "two attributes share a byte";
          written[place + byte] = true;
        }
      }
    }
  }
  std::size_t changed = 0;
  for (std::size_t byte = 0; byte < bytes.size(); ++byte)
    changed += !written[byte] && bytes[byte] != poison;
  EXPECT_EQ(changed, 0u) << "bytes beside the attributes";
}

TEST_F(SystemLayoutTest, WholeWordsStandWhereTheLayoutSays) {
  using enum VertexFormat;
  const VertexLayout layouts[] = {
      layoutOf(float32x3, none, none),
      layoutOf(float32x3, float32x3, float32x4, false, 76),
      layoutOf(float32x4, octahedral16x2, snorm8x4, true),
      layoutOf(float16x4, snorm8x4, octahedral16x2, false, 48),
      layoutOf(snorm16x4, float16x4, none, true),
  };
  SystemEngine engine(device(), context(), description());
  fillEngine(engine, layouts);
  expectOutput(engine);
}

TEST_F(SystemLayoutTest, AttributesOfHalfWordsShareWords) {
  using enum VertexFormat;
  VertexLayout layouts[] = {
      layoutOf(float16x3, octahedral8x2, none),
      layoutOf(snorm16x3, float16x3, octahedral16x2, false, 24),
      layoutOf(float16x3, float16x4, octahedral8x2),
      layoutOf(float16x3, none, octahedral8x2),
      layoutOf(float32x3, octahedral8x2, octahedral8x2),
  };
  for (VertexLayout& layout : layouts) {
    if (formatSize(layout.positions) % 4 != 0) layout.motion = false;
  }
  SystemEngine engine(device(), context(), description());
  fillEngine(engine, layouts);
  expectOutput(engine);
}

// Positions in snorm16 are relative to the instance's own box.
TEST_F(SystemLayoutTest, EachInstanceHasABoxOfItsOwn) {
  SystemEngine engine(device(), context(), description());
  engine.begin();
  palette_ = engine.addPose(pose_);
  InstanceDescription instance;
  instance.layout.positions = VertexFormat::snorm16x4;
  instance.mesh = engine.addMesh(meshes_[1]);
  instance.pose = palette_;
  for (const float half : {4.0f, 9.0f}) {
    instance.box = {{-half, -half, -half}, {half, half, half}};
    instances_.push_back({engine.addInstance(instance), instance, 1});
  }
  engine.submit();
  for (const Placed& placed : instances_)
    expectSkinned(engine.read(placed.handle), alone(meshes_[1], pose_, placed.description));
}

// What the engine wrote between the attributes is still there when all of them are skinned again.
TEST_F(SystemLayoutTest, TheEnginesOwnAttributesStay) {
  const VertexLayout layouts[] = {
      layoutOf(VertexFormat::float32x3, VertexFormat::float32x3, VertexFormat::none, false, 64)};
  SystemEngine engine(device(), context(), description());
  fillEngine(engine, layouts);
  engine.finish();
  engine.fillOutput(poison);
  for (int i = 0; i < 3; ++i) {
    engine.begin();
    engine.writePose(palette_, pose_);
    engine.submit();
  }
  expectOutput(engine);
}

}  // namespace
}  // namespace dermis::test
