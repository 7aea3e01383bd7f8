// A vertex layout places the attributes of any number of vertices, and foresees their pipelines.

#include "dermis/layout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "dermis/plan.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

constexpr VertexLayout full{.positions = VertexFormat::float32x3,
                            .normals = VertexFormat::octahedral16x2,
                            .tangents = VertexFormat::snorm8x4,
                            .motion = true};

void expectPlace(const OutputAttribute& attribute, std::uint64_t offset, std::uint32_t stride,
                 VertexFormat format) {
  EXPECT_EQ(attribute.offset, offset);
  EXPECT_EQ(attribute.stride, stride);
  EXPECT_EQ(attribute.format, format);
}

TEST(Layout, PlacesAttributesVertexByVertex) {
  const Result<VertexPlaces> places = placeVertices(full, 10, 320);
  ASSERT_TRUE(places.ok());
  expectPlace((*places)[Stream::positions], 320, 32, VertexFormat::float32x3);
  expectPlace((*places)[Stream::normals], 332, 32, VertexFormat::octahedral16x2);
  expectPlace((*places)[Stream::tangents], 336, 32, VertexFormat::snorm8x4);
  expectPlace((*places)[Stream::previousPositions], 340, 32, VertexFormat::float32x3);
  EXPECT_EQ(places->size, 320u);
  EXPECT_EQ(places->alignment, 32u);
  Job job;
  job.places = *places;
  EXPECT_TRUE(job.places.hasMotion());
  EXPECT_EQ(job.places[Stream::tangents].offset, 336u);
}

TEST(Layout, PlacesAttributesOneAfterTheOther) {
  VertexLayout layout = full;
  layout.planar = true;
  const Result<VertexPlaces> places = placeVertices(layout, 5, 48);
  ASSERT_TRUE(places.ok());
  expectPlace((*places)[Stream::positions], 48, 12, VertexFormat::float32x3);  // 60 bytes
  expectPlace((*places)[Stream::normals], 144, 4, VertexFormat::octahedral16x2);
  expectPlace((*places)[Stream::tangents], 192, 4, VertexFormat::snorm8x4);
  expectPlace((*places)[Stream::previousPositions], 240, 12, VertexFormat::float32x3);
  EXPECT_EQ(places->size, 288u);
}

TEST(Layout, RefusesWhatCannotStandSo) {
  const auto expectRefused = [](const VertexLayout& layout, std::uint64_t offset,
                                const std::string& text) {
    const Result<VertexPlaces> places = placeVertices(layout, 3, offset);
    ASSERT_FALSE(places.ok()) << text;
    EXPECT_EQ(places.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(places.error().message.find(text), std::string::npos) << places.error().message;
  };
  expectRefused(full, 16, "multiple of 32 bytes, not at 16");
  VertexLayout bad = full;
  bad.stride = 31;
  expectRefused(bad, 0, "stride of 31");
  bad.planar = true;
  expectRefused(bad, 0, "planar");
  EXPECT_FALSE(pipelines(PipelineNeeds{.layout = bad}, {}, {}).ok());
  bad = {};
  bad.positions = VertexFormat::none;  // nothing at all
  expectRefused(bad, 0, "positions cannot be stored as none");
  bad.positions = VertexFormat::snorm8x4;
  expectRefused(bad, 0, "snorm8x4");
}

// `placeVertices` places them for dermis::cpu, which stores bytes.
TEST(Layout, NoPipelineStoresRunsThatAreNotWholeWords) {
  const auto refusalOf = [](const VertexLayout& layout) {
    EXPECT_TRUE(placeVertices(layout, 3).ok());
    const Result<std::vector<PipelineId>> all = pipelines(PipelineNeeds{.layout = layout}, {}, {});
    return all ? "" : all.error().message;
  };
  using enum VertexFormat;
  VertexLayout layout{.positions = float16x3, .normals = octahedral8x2};
  EXPECT_EQ(refusalOf(layout), "");
  layout.motion = true;
  EXPECT_NE(refusalOf(layout).find("the layout: its previous positions as float16x3"),
            std::string::npos);
  layout.motion = false;
  layout.stride = 10;
  EXPECT_NE(refusalOf(layout).find("stride 10 of its positions"), std::string::npos);
  layout.stride = 0;
  layout.planar = true;
  EXPECT_NE(refusalOf(layout).find("use float16x4"), std::string::npos);
  EXPECT_EQ(refusalOf({.positions = float16x4, .planar = true}), "");
  EXPECT_NE(refusalOf({.normals = octahedral8x2}).find("use octahedral16x2"), std::string::npos);
  EXPECT_EQ(refusalOf({.normals = octahedral8x2, .tangents = octahedral8x2}), "");
}

// Wherever `placeVertices` lets them begin, jobs need no other pipelines.
TEST(Layout, ForeseesThePipelinesOfEveryPlace) {
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  for (const bool texels : {false, true}) {
    limits.texelBuffers = texels;
    for (const auto& [positions, normals] :
         {std::pair{VertexFormat::float32x3, VertexFormat::none},
          {VertexFormat::float32x3, VertexFormat::float32x3},
          {VertexFormat::float32x3, VertexFormat::octahedral16x2},
          {VertexFormat::float16x3, VertexFormat::octahedral8x2}}) {
      // 1: planar.
      for (const std::uint32_t stride : {0u, 1u, 24u, 36u, 40u, 52u}) {
        if (stride == 1 && positions == VertexFormat::float16x3) continue;
        // Of a scene: kernels count from the beginning of its output.
        for (const std::uint64_t outputOffset : {0u, 96u, 768u}) {
          PipelineNeeds needs{
              .layout = {.positions = positions, .normals = normals, .stride = stride}};
          if (stride == 1) needs.layout = {.normals = normals, .planar = true};
          const std::vector<Variant> foreseen = *everyVariant(needs, limits, {});
          const std::uint64_t alignment = placeVertices(needs.layout, 1)->alignment;
          const std::uint64_t first = (outputOffset + alignment - 1) / alignment;
          for (std::uint64_t place = first; place < first + 9; ++place) {
            Job job;
            job.method = needs.method;
            job.places = *placeVertices(needs.layout, 7, place * alignment);
            for (OutputAttribute& attribute : job.places.attributes)
              attribute.offset -= attribute.format != VertexFormat::none ? outputOffset : 0;
            job.mesh.byteSize = 512;
            job.mesh.vertexCount = 7;
            job.mesh.hasNormals = true;
            const PoseDescription pose{1};
            const Batch batch{
                {&pose, 1}, {&job, 1}, 512, 48, ByStream<std::uint64_t>::all(1 << 16)};
            Plan plan;
            ASSERT_TRUE(makePlan(batch, limits, {}, plan).ok());
            for (const Variant& variant : variantsOf(plan.pipelines())) {
              EXPECT_TRUE(std::ranges::find(foreseen, variant) != foreseen.end())
                  << stride << " bytes, at " << place * alignment << " of " << outputOffset;
            }
          }
        }
      }
    }
  }
  const std::vector<Variant> culled = *everyVariant(PipelineNeeds{.culledOnGpu = true}, {}, {});
  EXPECT_EQ(std::ranges::count(culled, Kernel::visibility, &Variant::kernel), 1);
}

}  // namespace
}  // namespace dermis::test
