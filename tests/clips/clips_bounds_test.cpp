// The boxes around meshes that clips move contain all vertices, and are not much larger than
// needed.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clip_rig.h"
#include "clip_variants.h"
#include "clips/bank.h"
#include "clips/sample.h"
#include "dermis/clips.h"
#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "exhaustive.h"
#include "few_cases.h"
#include "random_number.h"
#include "stored.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t posesPerClip = fewer(40u, 4u);

/// Those for which `skinnedBounds` has a proof.
constexpr Method provenMethods[] = {Method::linear, Method::dualQuaternion, Method::blended};

constexpr float farthest = std::numeric_limits<float>::infinity();

/// Some vertices of a primitive, evenly chosen. The primitive must outlive it.
class FewVertices {
 public:
  explicit FewVertices(const gltf::Primitive& primitive) : view_(primitive), mesh_(view_.mesh()) {
    constexpr std::uint32_t most = 150;
    const std::uint32_t step = mesh_.vertexCount / most + 1;
    mesh_.vertexCount /= step;
    mesh_.morphTargets = {};
    mesh_.normals = mesh_.tangents = {};
    const auto thin = [&](AttributeView& attribute) {
      attribute.stride *= step;
      attribute.count = mesh_.vertexCount;
    };
    thin(mesh_.positions);
    sets_.assign(mesh_.influenceSets.begin(), mesh_.influenceSets.end());
    for (InfluenceSet& set : sets_) {
      thin(set.joints);
      thin(set.weights);
    }
    mesh_.influenceSets = sets_;
  }
  FewVertices(const FewVertices&) = delete;
  FewVertices& operator=(const FewVertices&) = delete;

  const MeshView& mesh() const { return mesh_; }

 private:
  gltf::PrimitiveView view_;
  std::vector<InfluenceSet> sets_;
  MeshView mesh_;
};

/// Vertices near the joints of a skin, each with up to four influences: joints without order.
gltf::Primitive scatteredMesh(const PackedRig& rig, std::uint32_t skin, std::mt19937& random) {
  gltf::Primitive primitive;
  primitive.vertexCount = 60;
  const std::vector<JointMatrix> rest = rig.sample(std::span<const ClipLayer>{}, skin);
  std::vector<float> positions, weights;
  std::vector<std::uint16_t> joints;
  for (std::uint32_t vertex = 0; vertex < primitive.vertexCount; ++vertex) {
    for (int axis = 0; axis < 3; ++axis)
      positions.push_back(static_cast<float>(rig.extent() * between(random, -0.5, 0.5)));
    const std::uint32_t influences = 1 + below(random, 4);
    for (std::uint32_t i = 0; i < 4; ++i) {
      joints.push_back(static_cast<std::uint16_t>(below(random, rest.size())));
      weights.push_back(i < influences ? static_cast<float>(between(random, 0.05, 1)) : 0.0f);
    }
  }
  gltf::Influences set;
  set.jointType = ComponentType::uint16;
  set.weightType = ComponentType::float32;
  const auto bytesOf = [](const auto& values) {
    const auto bytes = std::as_bytes(std::span(values));
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  set.joints = bytesOf(joints);
  set.weights = bytesOf(weights);
  primitive.positions = std::move(positions);
  primitive.influences.push_back(std::move(set));
  return primitive;
}

void extend(Box& box, const reference::Double3& position) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.min[axis] = std::min(box.min[axis], static_cast<float>(position[axis]));
    box.max[axis] = std::max(box.max[axis], static_cast<float>(position[axis]));
  }
}

double diagonalOf(const Box& box) {
  double squares = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double side = double{box.max[axis]} - double{box.min[axis]};
    squares += side * side;
  }
  return std::sqrt(squares);
}

constexpr Box noBox{{farthest, farthest, farthest}, {-farthest, -farthest, -farthest}};

/// A mesh, a box around all of its poses, and the box around what was found.
struct Boxed {
  const MeshView& mesh;
  std::uint32_t skin;
  Method method;
  Box box;
  Box found = noBox;

  /// Checks a pose: all positions of the reference, and all that the accuracy contract allows.
  void check(const PackedRig& rig, std::span<const ClipLayer> layers) {
    const Result<reference::SkinnedMesh> skinned =
        reference::skin(mesh, rig.sample(layers, skin), method);
    ASSERT_TRUE(skinned.ok()) << skinned.error().message;
    for (std::size_t vertex = 0; vertex < skinned->positions.size(); ++vertex) {
      const reference::Double3& position = skinned->positions[vertex];
      const double margin = skinned->bounds[vertex].position;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        ASSERT_GE(position[axis] - margin, double{box.min[axis]})
            << methodName(method) << ", vertex " << vertex << ", axis " << axis;
        ASSERT_LE(position[axis] + margin, double{box.max[axis]})
            << methodName(method) << ", vertex " << vertex << ", axis " << axis;
      }
      extend(found, position);
    }
  }

  double ratio() const { return diagonalOf(box) / diagonalOf(found); }
};

/// How much larger boxes are than what was found.
struct Ratios {
  double sum = 0, worst = 0, seconds = 0;
  int count = 0;

  void add(const Boxed& boxed) {
    if (!(diagonalOf(boxed.found) > 0)) return;
    sum += boxed.ratio();
    worst = std::max(worst, boxed.ratio());
    ++count;
  }
  void print(const char* what) const {
    std::printf("%s: %d boxes in %.2f s, %.3f of what is needed in the mean, at most %.3f\n", what,
                count, seconds, sum / count, worst);
  }
};

/// A clip alone, at random times, at its ends, and beyond them.
void checkClips(const PackedRig& rig, const MeshView& mesh, std::uint32_t skin, Method method,
                std::uint32_t times, std::mt19937& random, Ratios& ratios) {
  const Result<JointBounds> joints = jointBounds(mesh, rig.bank->jointCount(skin));
  ASSERT_TRUE(joints.ok()) << joints.error().message;
  const JointPromise promise = rigidSkins(*rig.bank)[skin] && chance(random, 50)
                                   ? JointPromise::rigid
                                   : JointPromise::scaling;
  for (std::uint32_t clip = 0; clip < rig.clips.size(); ++clip) {
    SCOPED_TRACE("clip " + std::to_string(clip));
    const auto start = std::chrono::steady_clock::now();
    const Result<Box> box = clipBounds(*rig.bank, clip, skin, *joints, method, promise);
    ratios.seconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    ASSERT_TRUE(box.ok()) << box.error().message;
    Boxed boxed{mesh, skin, method, *box};
    const double duration = double{rig.bank->clip(clip).duration};
    for (std::uint32_t i = 0; i < times; ++i) {
      ClipLayer layer{.clip = clip, .time = duration * between(random, -0.1, 1.1)};
      if (i == 0) layer.time = 0;
      if (i == 1) layer.time = duration;
      layer.hold = chance(random, 20) || i == 1;
      if (!rig.clips[clip].additive) layer.weight = static_cast<float>(between(random, 0.1, 2));
      boxed.check(rig, {&layer, 1});
      if (::testing::Test::HasFatalFailure()) return;
    }
    ratios.add(boxed);
  }
}

/// Any layers of the clips that are not additive.
void checkBlends(const PackedRig& rig, const MeshView& mesh, std::uint32_t skin, Method method,
                 std::uint32_t poses, std::mt19937& random, Ratios& ratios) {
  const Result<JointBounds> joints = jointBounds(mesh, rig.bank->jointCount(skin));
  ASSERT_TRUE(joints.ok()) << joints.error().message;
  std::vector<std::uint32_t> clips;
  for (std::uint32_t clip = 0; clip < rig.clips.size(); ++clip) {
    if (!rig.clips[clip].additive) clips.push_back(clip);
  }
  const auto start = std::chrono::steady_clock::now();
  const Result<Box> box = blendBounds(*rig.bank, clips, skin, *joints, method);
  ratios.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  ASSERT_TRUE(box.ok()) << box.error().message;
  Boxed boxed{mesh, skin, method, *box};
  for (std::uint32_t i = 0; i < poses; ++i) {
    std::vector<ClipLayer> layers(below(random, maxClipLayers + 1));
    for (ClipLayer& layer : layers) {
      layer.clip = clips[below(random, clips.size())];
      layer.time = double{rig.bank->clip(layer.clip).duration} * between(random, -1, 2);
      layer.weight = static_cast<float>(chance(random, 20) ? 0 : between(random, 0, 1.5));
      layer.mask = below(random, rig.masks.size() + 1);
    }
    boxed.check(rig, layers);
    if (::testing::Test::HasFatalFailure()) return;
  }
  ratios.add(boxed);
}

/// Adds a clip that does not wrap, differences from the rest pose, and masks.
void addLayers(PackedRig& rig, std::mt19937& random) {
  ClipView once = rig.clips[0], fromRest = rig.clips.back();
  once.wraps = false;
  fromRest.additive = true;
  rig.clips.insert(rig.clips.end(), {once, fromRest});
  for (int mask = 0; mask < 2; ++mask) {
    Floats& factors = rig.masks.emplace_back(rig.skeleton.nodes.size());
    for (float& factor : factors)
      factor = static_cast<float>(chance(random, 30) ? 0 : between(random, 0, 1));
  }
}

TEST(ClipsBounds, ContainModels) {
  Ratios samples, clips, blends;
  forEachAnimatedModel(fewer(2u, 2u), [&](gltf::Model model, std::uint32_t number) {
    std::mt19937 random(number);
    PackedRig rig(std::move(model));
    addLayers(rig, random);
    if (!rig.pack()) return;
    std::uint32_t meshes = 0;
    for (const gltf::SkinnedPrimitive& skinned : rig.model.skinnedPrimitives) {
      const gltf::Primitive& primitive =
          rig.model.meshes[skinned.mesh].primitives[skinned.primitive];
      const FewVertices few(primitive);
      if (few.mesh().influenceSets.empty() || !jointBounds(few.mesh(), maxPoseJoints)) continue;
      SCOPED_TRACE("skin " + std::to_string(skinned.skin));
      const Method method = provenMethods[(number + meshes) % 3];
      checkClips(rig, few.mesh(), skinned.skin, method, posesPerClip, random,
                 number < 3 ? samples : clips);
      checkBlends(rig, few.mesh(), skinned.skin, method, posesPerClip, random, blends);
      if (++meshes == 2 || ::testing::Test::HasFailure()) return;
    }
  });
  samples.print("clips of samples");
  clips.print("clips of other models");
  blends.print("blends");
  EXPECT_TRUE(samples.worst < 1.3 || hasFewCases);
}

/// Clips with jumps, splines, spins, scales that change their sign; meshes whose vertices have
/// joints that are far apart.
TEST(ClipsBounds, ContainVariants) {
  Ratios clips, blends;
  const auto check = [&](const gltf::Model& model, std::uint32_t number) {
    for (const ClipVariant variant : clipVariants) {
      SCOPED_TRACE(clipVariantName(variant));
      std::mt19937 random(number);
      PackedRig rig(withVariant(model, variant, number));
      addLayers(rig, random);
      if (!rig.pack()) continue;
      const gltf::Primitive primitive = scatteredMesh(rig, 0, random);
      const gltf::PrimitiveView view(primitive);
      for (const Method method : provenMethods) {
        if (hasFewCases && method != provenMethods[static_cast<std::size_t>(variant) % 3]) continue;
        checkClips(rig, view.mesh(), 0, method, posesPerClip, random, clips);
        checkBlends(rig, view.mesh(), 0, method, posesPerClip, random, blends);
      }
    }
  };
  check(armRig(), 0);
  if (!hasFewCases) {
    forEachAnimatedModel(fewer(2u, 2u), [&](const gltf::Model& model, std::uint32_t number) {
      if (number < (isExhaustive ? 3u : 1u)) check(model, number + 1);
    });
  }
  clips.print("clips");
  blends.print("blends");
}

/// The hand is far out while the arm still points one way, and back when the arm jumps to another.
/// If the arm turned gradually, nothing would be as far out.
TEST(ClipsBounds, ContainWhatIsReachedBeforeAJump) {
  gltf::Model model = armRig();
  gltf::Clip clip{"jump", 1, {}};
  clip.channels = {channel(arm::hand, ChannelPath::translation, {0, 0.25f, 0.5f, 1},
                           {0, 0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 0}),
                   channel(arm::upper, ChannelPath::rotation, {0, 0.5f, 1},
                           {0, 0, 0, 1, 0, 0, 0.8f, 0.6f, 0, 0, 0.8f, 0.6f}, Interpolation::step)};
  model.clips = {std::move(clip)};
  PackedRig rig(std::move(model));
  ASSERT_TRUE(rig.pack());
  std::mt19937 random(1);
  const gltf::Primitive primitive = scatteredMesh(rig, 0, random);
  const gltf::PrimitiveView view(primitive);
  Ratios ratios;
  checkClips(rig, view.mesh(), 0, Method::linear, 200, random, ratios);
  ratios.print("jump");
  EXPECT_LT(ratios.worst, 1.1);
}

/// A bank whose nodes are below each other and at rest. Its skin has the last of them, and a joint
/// below none.
PackedClips deepBank(std::uint32_t nodes) {
  std::vector<std::uint32_t> words(sizeof(BankHeader) / 4);
  const auto end = [&] { return static_cast<std::uint32_t>(words.size()); };
  const auto append = [&](const auto& record) {
    const std::uint32_t place = end();
    words.resize(words.size() + sizeof(record) / 4);
    std::memcpy(&words[place], &record, sizeof(record));
    return place;
  };
  BankHeader header{};
  header.magic = clipsMagic;
  header.version = clipsVersion;
  header.nodeCount = nodes;
  header.skinCount = header.clipCount = 1;
  header.nodes = end();
  for (std::uint32_t i = 0; i < nodes; ++i) {
    BankNode node{};
    node.parent = i == 0 ? noNode : i - 1;
    node.source = i;
    node.rotation[3] = 1;
    std::ranges::fill(node.scale, 1.0f);
    append(node);
  }
  BankSkin skin{};
  skin.jointCount = 2;
  skin.nodes = append(std::array<std::uint32_t, 4>{nodes - 1, noNode});
  skin.matrices = append(std::array<JointMatrix, 2>{});
  header.skins = append(skin);
  BankClip clip{};
  clip.classes = clip.tracks = end();
  words.resize(words.size() + (std::size_t{3} * nodes + 3) / 4 * 4);
  header.clips = append(clip);
  header.masks = header.morphed = end();
  std::memcpy(words.data(), &header, sizeof(header));
  finishStored(words);
  return *PackedClips::fromBytes(std::as_bytes(std::span(words)));
}

// A file may have as many nodes below each other as it likes.
TEST(ClipsBounds, OfADeepSkeletonNeedNoDeepStack) {
  const PackedClips bank = deepBank(100'000);
  const std::array<float, 3> position{1, 2, 3};
  const std::array<float, 2> weights{0.5f, 0.5f};
  const std::array<std::uint32_t, 2> joints{0, 1};
  const InfluenceSet set{{joints.data(), 1, 8, ComponentType::uint32, 2},
                         {weights.data(), 1, 8, ComponentType::float32, 2}};
  MeshView mesh;
  mesh.vertexCount = 1;
  mesh.positions = attributeView(position.data(), 1, 3);
  mesh.influenceSets = {&set, 1};
  const JointBounds reach = *jointBounds(mesh, 2);
  const std::uint32_t first = 0;
  for (const Result<Box>& box :
       {clipBounds(bank, 0, 0, reach, Method::dualQuaternion),
        blendBounds(bank, {&first, 1}, 0, reach, Method::dualQuaternion)}) {
    ASSERT_TRUE(box.ok());
    EXPECT_LE(box->min[1], 2);
    EXPECT_GE(box->max[1], 2);
  }
}

TEST(ClipsBounds, RefuseBadArguments) {
  PackedRig rig(armRig());
  std::mt19937 random(1);
  addLayers(rig, random);
  ASSERT_TRUE(rig.pack());
  const gltf::Primitive primitive = scatteredMesh(rig, 0, random);
  const gltf::PrimitiveView view(primitive);
  const JointBounds joints = *jointBounds(view.mesh(), maxPoseJoints);
  const std::uint32_t both[] = {0, 1}, none[] = {0, 4}, additive[] = {0, 3};
  const auto messageOf = [](const Result<Box>& result) {
    EXPECT_FALSE(result.ok());
    if (result.ok()) return std::string();
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
    return result.error().message;
  };
  const Method method = Method::linear;
  EXPECT_EQ(messageOf(clipBounds(*rig.bank, 4, 0, joints, method)),
            "clipBounds: there is no clip 4; the bank has 4");
  EXPECT_EQ(messageOf(clipBounds(*rig.bank, 0, 9, joints, method)),
            "clipBounds: there is no skin 9; the bank has 2");
  EXPECT_EQ(messageOf(blendBounds(*rig.bank, none, 0, joints, method)),
            "blendBounds: there is no clip 4; the bank has 4");
  EXPECT_EQ(messageOf(blendBounds(*rig.bank, both, 9, joints, method)),
            "blendBounds: there is no skin 9; the bank has 2");
  EXPECT_EQ(messageOf(blendBounds(*rig.bank, additive, 0, joints, method)),
            "blendBounds: clip 3 is additive, and its weight may be any number: there is no box "
            "for all of its blends");
  // Skin 1 has fewer joints.
  ASSERT_LT(rig.bank->jointCount(1), rig.bank->jointCount(0));
  EXPECT_NE(messageOf(clipBounds(*rig.bank, 0, 1, joints, method)).find("joints, but skin 1 has"),
            std::string::npos);
  EXPECT_NE(messageOf(blendBounds(*rig.bank, both, 1, joints, method)).find("joints, but skin 1"),
            std::string::npos);
}

TEST(ClipsBounds, AreInfiniteOrEmptyIfThoseOfAPoseAre) {
  PackedRig rig(armRig());
  ASSERT_TRUE(rig.pack());
  std::mt19937 random(1);
  const gltf::Primitive primitive = scatteredMesh(rig, 0, random);
  const gltf::PrimitiveView view(primitive);
  const JointBounds joints = *jointBounds(view.mesh(), rig.bank->jointCount(0));
  const std::uint32_t clips[] = {0, 1};
  for (const Result<Box>& box : {clipBounds(*rig.bank, 0, 0, joints, Method::centerOfRotation),
                                 blendBounds(*rig.bank, clips, 0, joints, Method::logMatrix)}) {
    ASSERT_TRUE(box.ok());
    EXPECT_EQ(box->min[0], -farthest);
    EXPECT_EQ(box->max[2], farthest);
  }
  for (const Result<Box>& box : {clipBounds(*rig.bank, 0, 0, {}, Method::linear),
                                 blendBounds(*rig.bank, clips, 0, {}, Method::linear)}) {
    ASSERT_TRUE(box.ok());
    EXPECT_GT(box->min[0], box->max[0]);
  }
}

}  // namespace
}  // namespace dermis::test
