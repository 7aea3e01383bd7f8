// What `packClips` gets of a model: all nodes, skins and clips, with their numbers and names.
#include <algorithm>

#include "gltf_builder.h"

namespace dermis::test {
namespace {

/// Node 3 has a matrix; node 1 is moved and turned, and the mesh has animated weights.
gltf::Model model() {
  FileBuilder file = skinnedTriangle();
  file.json["nodes"].push_back(
      {{"name", "matrix"}, {"matrix", {1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 9, 0, 10, 11, 12, 1}}});
  file.json["nodes"][1]["children"].push_back(3);
  file.json["skins"][0]["name"] = "skin";
  file.primitive()["targets"] = {
      {{"POSITION", file.addFloats({0, 0, 0, 0, 0, 0, 0, 0, 1}, "VEC3")}}};
  const std::size_t times = file.addFloats({0, 1}, "SCALAR");
  file.json["animations"] = {
      {{"name", "move"},
       {"samplers",
        {{{"input", times}, {"output", file.addFloats({1, 2, 3, 4, 5, 6}, "VEC3")}},
         {{"input", times},
          {"output", file.addFloats({0, 0, 0, 1, 0, 0, 1, 0}, "VEC4")},
          {"interpolation", "STEP"}},
         {{"input", times}, {"output", file.addFloats({0, 1}, "SCALAR")}}}},
       {"channels",
        {{{"sampler", 2}, {"target", {{"node", 0}, {"path", "weights"}}}},
         {{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}},
         {{"sampler", 1}, {"target", {{"node", 1}, {"path", "rotation"}}}}}}}};
  return loaded(file);
}

TEST(GltfSkeleton, HasAllNodes) {
  const gltf::Model from = model();
  const Skeleton skeleton = gltf::skeleton(from);
  ASSERT_EQ(skeleton.nodes.size(), 4u);
  for (std::size_t node = 0; node < 4; ++node) {
    EXPECT_EQ(skeleton.nodes[node].name, from.nodes[node].name);
    EXPECT_EQ(skeleton.nodes[node].parent, from.nodes[node].parent);
    EXPECT_EQ(skeleton.nodes[node].translation, from.nodes[node].translation);
    EXPECT_EQ(skeleton.nodes[node].rotation, from.nodes[node].rotation);
    EXPECT_EQ(skeleton.nodes[node].scale, from.nodes[node].scale);
    EXPECT_EQ(skeleton.nodes[node].matrix.has_value(), node == 3);
  }
  const Transform rows{{{1, 4, 7, 10}, {2, 5, 8, 11}, {3, 6, 9, 12}}};
  EXPECT_EQ(skeleton.nodes[3].matrix, rows);
  EXPECT_EQ(skeleton.nodes[3].parent, 1u);
  EXPECT_EQ(skeleton.nodes[0].parent, 0xffffffffu);
}

TEST(GltfSkeleton, HasAllSkins) {
  const gltf::Model from = model();
  const Skeleton skeleton = gltf::skeleton(from);
  ASSERT_EQ(skeleton.skins.size(), 1u);
  EXPECT_EQ(skeleton.skins[0].name, "skin");
  EXPECT_TRUE(std::ranges::equal(skeleton.skins[0].joints, from.skins[0].joints));
  EXPECT_EQ(skeleton.skins[0].inverseBind.data(), from.skins[0].inverseBindMatrices.data());
  EXPECT_EQ(skeleton.skins[0].inverseBind.size(), 2u);
}

TEST(GltfSkeleton, ClipsHaveAllChannels) {
  const gltf::Model from = model();
  const std::vector<ClipView> clips = gltf::clips(from);
  ASSERT_EQ(clips.size(), 1u);
  const ClipView& clip = clips[0];
  EXPECT_EQ(clip.name, "move");
  EXPECT_EQ(clip.duration, 1);
  EXPECT_TRUE(clip.wraps);
  EXPECT_FALSE(clip.additive);
  ASSERT_EQ(from.clips.at(0).channels.size(), 3u);
  ASSERT_EQ(clip.channels.size(), 3u);
  EXPECT_EQ(clip.channels[0].path, ChannelPath::weights);
  EXPECT_EQ(clip.channels[1].path, ChannelPath::translation);
  EXPECT_EQ(clip.channels[1].interpolation, Interpolation::linear);
  EXPECT_EQ(clip.channels[2].path, ChannelPath::rotation);
  EXPECT_EQ(clip.channels[2].interpolation, Interpolation::step);
  for (std::size_t i = 0; i < 3; ++i) {
    const gltf::Channel& channel = from.clips[0].channels[i];
    EXPECT_EQ(clip.channels[i].node, i == 0 ? 0u : 1u);
    EXPECT_EQ(clip.channels[i].times.data(), channel.times.data());
    EXPECT_EQ(clip.channels[i].times.size(), 2u);
    EXPECT_EQ(clip.channels[i].values.data(), channel.values.data());
    EXPECT_EQ(clip.channels[i].values.size(), channel.values.size());
  }
}

// A model without skins and clips has none; `packClips` says so.
TEST(GltfSkeleton, OfAModelWithoutSkins) {
  FileBuilder file;
  file.json["nodes"] = {{{"name", "alone"}}};
  const gltf::Model from = loaded(file);
  EXPECT_EQ(gltf::skeleton(from).nodes.size(), 1u);
  EXPECT_TRUE(gltf::skeleton(from).skins.empty());
  EXPECT_TRUE(gltf::clips(from).empty());
}

}  // namespace
}  // namespace dermis::test
