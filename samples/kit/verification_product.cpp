#include "kit/verification_product.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "kit/method_rotation.h"

namespace dermis::samples {
namespace {

/// Takes one value after another out of a combination.
class Choice {
 public:
  explicit Choice(const std::vector<std::uint32_t>& combination) : combination_(combination) {}
  template <typename Values>
  auto of(const Values& values) {
    return values[combination_[next_++]];
  }

 private:
  const std::vector<std::uint32_t>& combination_;
  std::size_t next_ = 0;
};

template <typename... Values>
std::vector<std::uint32_t> countsOf(const Values&... values) {
  return {static_cast<std::uint32_t>(values.size())...};
}

/// Possible values of an output case.
struct OutputValues {
  std::span<const VertexFormat> positions, normals, tangents;
  std::span<const Arrangement> arrangements;
  std::span<const std::uint32_t> gaps;
  std::span<const bool> motions;
  std::span<const bool> bounds;
  std::span<const Tuning> tunings;

  std::vector<std::uint32_t> counts() const {
    return countsOf(positions, normals, tangents, arrangements, gaps, motions, bounds, tunings);
  }
};

/// Possible values of a random mesh.
struct InputValues {
  std::span<const Rigidity> rigidities;
  std::span<const std::uint32_t> vertices, joints, influences, morphs;
  std::span<const ComponentType> positionTypes, directionTypes, jointTypes, weightTypes;
  std::span<const std::uint32_t> setSizes, gaps;

  std::vector<std::uint32_t> counts() const {
    return countsOf(rigidities, vertices, joints, influences, morphs, positionTypes, directionTypes,
                    jointTypes, weightTypes, setSizes, gaps);
  }
};

constexpr std::array arrangements{Arrangement::interleaved, Arrangement::planar,
                                  Arrangement::separate, Arrangement::directionsTogether};
constexpr std::array<std::uint32_t, 2> gaps{0, 4};
constexpr std::array motions{false, true};
constexpr std::array either{false, true};
constexpr std::array<Tuning, 5> tunings{{{64, 4}, {8, 1}, {16, 2}, {32, 3, 1000}, {128, 16}}};
constexpr OutputValues allOutputs{verifiedPositionFormats,
                                  verifiedNormalFormats,
                                  verifiedTangentFormats,
                                  arrangements,
                                  gaps,
                                  motions,
                                  either,
                                  tunings};

constexpr std::array rigidities{Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                Rigidity::mirrored, Rigidity::mirroredAlongOneAxis};
constexpr std::array<std::uint32_t, 6> vertexCounts{1, 7, 64, 65, 257, 1234};
constexpr std::array<std::uint32_t, 4> jointCounts{1, 3, 40, 300};
constexpr std::array<std::uint32_t, 6> influenceCounts{1, 2, 4, 7, 17, 64};
constexpr std::array<std::uint32_t, 3> morphCounts{0, 1, 5};
constexpr std::array positionTypes{ComponentType::float32, ComponentType::float16,
                                   ComponentType::snorm16, ComponentType::unorm16};
constexpr std::array directionTypes{ComponentType::float32, ComponentType::float16,
                                    ComponentType::snorm8, ComponentType::snorm16};
constexpr std::array jointTypes{ComponentType::uint8, ComponentType::uint16, ComponentType::uint32};
constexpr std::array weightTypes{ComponentType::float32, ComponentType::unorm8,
                                 ComponentType::unorm16};
constexpr std::array<std::uint32_t, 3> setSizes{1, 4, 5};
constexpr std::array<std::uint32_t, 2> inputGaps{0, 3};
constexpr InputValues allInputs{rigidities,  vertexCounts,  jointCounts,    influenceCounts,
                                morphCounts, positionTypes, directionTypes, jointTypes,
                                weightTypes, setSizes,      inputGaps};

// Each method is combined with each value. Most combinations need a pipeline of their own, which
// takes time to build. So Coverage::quick has at most three values of each parameter: common
// formats of different encodings, and numbers of influences with different kernels.
constexpr std::array quickPositions{VertexFormat::float32x3, VertexFormat::float16x3,
                                    VertexFormat::snorm16x4};
constexpr std::array quickNormals{VertexFormat::float32x3, VertexFormat::none,
                                  VertexFormat::octahedral8x2};
constexpr std::array quickTangents{VertexFormat::none, VertexFormat::float32x4,
                                   VertexFormat::octahedral8x2};
constexpr std::array quickArrangements{Arrangement::interleaved, Arrangement::planar,
                                       Arrangement::separate};
constexpr std::array<Tuning, 2> quickTunings{{{64, 4}, {32, 3, 1000}}};
constexpr std::array quickRigidities{Rigidity::rigid, Rigidity::shear, Rigidity::mirrored};
constexpr std::array<std::uint32_t, 2> quickVertexCounts{65, 1234};
constexpr std::array<std::uint32_t, 2> quickJointCounts{5, 300};
constexpr std::array<std::uint32_t, 3> quickInfluenceCounts{1, 4, 7};
constexpr std::array<std::uint32_t, 2> quickMorphCounts{0, 3};
constexpr std::array quickTypes{ComponentType::float32, ComponentType::float16,
                                ComponentType::snorm16};

constexpr OutputValues outputValues(Coverage coverage) {
  OutputValues values = allOutputs;
  if (coverage == Coverage::full) return values;
  values.positions = quickPositions;
  values.normals = quickNormals;
  values.tangents = quickTangents;
  values.arrangements = quickArrangements;
  values.tunings = quickTunings;
  return values;
}

constexpr InputValues inputValues(Coverage coverage) {
  InputValues values = allInputs;
  if (coverage == Coverage::full) return values;
  values.rigidities = quickRigidities;
  values.vertices = quickVertexCounts;
  values.joints = quickJointCounts;
  values.influences = quickInfluenceCounts;
  values.morphs = quickMorphCounts;
  values.positionTypes = values.directionTypes = quickTypes;
  return values;
}

/// Whether runs of attributes can be whole words (`OutputAttribute`) with these values of the first
/// parameters and some values of those that are not chosen. Each mesh writes the attributes that it
/// has.
bool areRunsPossible(const OutputValues& values, std::span<const std::uint32_t> chosen,
                     std::span<const MeshInfo> meshes) {
  const auto mayBe = [&](std::size_t parameter, const auto& all, auto is) {
    return chosen[parameter] != notChosen ? is(all[chosen[parameter]])
                                          : std::ranges::any_of(all, is);
  };
  const auto mayBeSmall = [&](std::size_t parameter, std::span<const VertexFormat> all,
                              bool isSmall) {
    return mayBe(parameter, all,
                 [=](VertexFormat format) { return (formatSize(format) % 4 != 0) == isSmall; });
  };
  const auto mayStand = [&](Arrangement one) {
    return mayBe(3, values.arrangements, [=](Arrangement other) { return other == one; });
  };
  const bool isInterleaved = mayStand(Arrangement::interleaved);
  const bool isStill = mayBe(5, values.motions, [](bool motion) { return !motion; });
  for (unsigned small = 0; small < 8; ++small) {
    const bool positions = (small & 1) != 0, normals = (small & 2) != 0,
               tangents = (small & 4) != 0;
    const bool isPlaced =
        small == 0 || isInterleaved || (!positions && mayStand(Arrangement::directionsTogether));
    const bool isWhole = std::ranges::all_of(meshes, [=](const MeshInfo& mesh) {
      return positions == ((normals && mesh.hasNormals) != (tangents && mesh.hasTangents));
    });
    if (isPlaced && isWhole && (!positions || isStill) &&
        mayBeSmall(0, values.positions, positions) && mayBeSmall(1, values.normals, normals) &&
        mayBeSmall(2, values.tangents, tangents))
      return true;
  }
  return false;
}

MeshInfo completeMesh() {
  MeshInfo info;
  info.hasNormals = info.hasTangents = true;
  return info;
}

OutputCase chooseOutput(Choice& choice, const OutputValues& values) {
  OutputCase output;
  output.layout.positions = choice.of(values.positions);
  output.layout.normals = choice.of(values.normals);
  output.layout.tangents = choice.of(values.tangents);
  output.layout.arrangement = choice.of(values.arrangements);
  output.layout.gap = choice.of(values.gaps);
  output.layout.motion = choice.of(values.motions);
  output.layout.bounds = choice.of(values.bounds);
  output.tuning = choice.of(values.tunings);
  return output;
}

/// Reduces a case to what the device supports.
OutputCase supported(OutputCase output, const DeviceLimits& limits) {
  if (limits.maxStorageBuffersPerStage >= storageBuffersWanted) return output;
  OutputLayout& layout = output.layout;
  if (layout.arrangement == Arrangement::separate) layout.arrangement = Arrangement::planar;
  if (layout.positions == VertexFormat::snorm16x3) layout.positions = VertexFormat::float16x3;
  if (layout.positions == VertexFormat::snorm16x4) layout.positions = VertexFormat::float16x4;
  layout.bounds = false;
  return output;
}

std::string_view typeName(ComponentType type) {
  switch (type) {
    case ComponentType::float32:
      return "float32";
    case ComponentType::float16:
      return "float16";
    case ComponentType::snorm8:
      return "snorm8";
    case ComponentType::snorm16:
      return "snorm16";
    case ComponentType::unorm8:
      return "unorm8";
    case ComponentType::unorm16:
      return "unorm16";
    case ComponentType::uint8:
      return "uint8";
    case ComponentType::uint16:
      return "uint16";
    case ComponentType::uint32:
      return "uint32";
  }
  return "";
}

}  // namespace

std::string OutputCase::name() const {
  std::string text = "positions " + std::string(formatName(layout.positions));
  if (layout.normals != VertexFormat::none)
    text += ", normals " + std::string(formatName(layout.normals));
  if (layout.tangents != VertexFormat::none)
    text += ", tangents " + std::string(formatName(layout.tangents));
  text += layout.arrangement == Arrangement::interleaved ? ", interleaved"
          : layout.arrangement == Arrangement::planar    ? ", planar"
          : layout.arrangement == Arrangement::separate  ? ", separate"
                                                         : ", directions together";
  if (layout.gap != 0) text += ", gaps of " + std::to_string(layout.gap);
  if (layout.motion) text += ", previous kept";
  if (layout.bounds) text += ", bounds";
  return text + ", " + std::to_string(tuning.workgroupSize) + " invocations, " +
         std::to_string(tuning.instancesPerInvocation) + " instances each";
}

std::string RandomCase::inputName() const {
  std::string text =
      std::to_string(vertices) + " vertices, " + std::to_string(joints) + " joints as " +
      std::string(typeName(input.joints)) + ", " + std::to_string(influences) + " weights as " +
      std::string(typeName(input.weights)) + " in sets of " + std::to_string(input.setSize) +
      ", positions as " + std::string(typeName(input.positions)) + ", directions as " +
      std::string(typeName(input.directions));
  if (morphs != 0) text += ", " + std::to_string(morphs) + " morph targets";
  static constexpr std::array<const char*, 5> poses{"rigid", "scaled", "sheared", "mirrored",
                                                    "mirrored along one axis"};
  return text + ", " + poses[static_cast<std::size_t>(rigidity)];
}

std::vector<OutputCase> outputCases(const DeviceLimits& limits, Coverage coverage,
                                    std::span<const MeshInfo> meshes) {
  const OutputValues values = outputValues(coverage);
  const MeshInfo complete = completeMesh();
  if (meshes.empty()) meshes = {&complete, 1};
  std::vector<OutputCase> cases;
  const auto isPossible = [&](std::span<const std::uint32_t> chosen) {
    return areRunsPossible(values, chosen, meshes);
  };
  for (const std::vector<std::uint32_t>& combination :
       pairwiseCombinations(values.counts(), isPossible)) {
    Choice choice(combination);
    cases.push_back(supported(chooseOutput(choice, values), limits));
  }
  return cases;
}

std::vector<RandomCase> randomCases(const BatchTarget& target, Coverage coverage) {
  const std::span<const Method> methods = target.methods();
  const InputValues inputs = inputValues(coverage);
  const OutputValues outputs = outputValues(coverage);
  std::vector<std::uint32_t> counts = countsOf(methods);
  for (const std::vector<std::uint32_t>& others : {inputs.counts(), outputs.counts()})
    counts.insert(counts.end(), others.begin(), others.end());
  std::vector<RandomCase> cases;
  const MeshInfo complete = completeMesh();
  const auto isPossible = [&](std::span<const std::uint32_t> chosen) {
    return areRunsPossible(outputs, chosen.last(outputs.counts().size()), {&complete, 1});
  };
  for (const std::vector<std::uint32_t>& combination : pairwiseCombinations(counts, isPossible)) {
    Choice choice(combination);
    RandomCase random;
    random.method = choice.of(methods);
    random.rigidity = choice.of(inputs.rigidities);
    random.vertices = choice.of(inputs.vertices);
    random.joints = choice.of(inputs.joints);
    random.influences = choice.of(inputs.influences);
    random.morphs = choice.of(inputs.morphs);
    random.input.positions = choice.of(inputs.positionTypes);
    random.input.directions = choice.of(inputs.directionTypes);
    random.input.joints = choice.of(inputs.jointTypes);
    random.input.weights = choice.of(inputs.weightTypes);
    random.input.setSize = choice.of(inputs.setSizes);
    random.input.gap = choice.of(inputs.gaps);
    if (random.input.joints == ComponentType::uint8)
      random.joints = std::min(random.joints, std::uint32_t{256});
    random.output = supported(chooseOutput(choice, outputs), target.limits());
    cases.push_back(random);
  }
  return cases;
}

Result<std::vector<VerifiedInstance>> verifyRandomCase(BatchTarget& target,
                                                       const RandomCase& random) {
  OwnedMesh mesh = randomMesh(1, random.vertices, random.joints, random.influences);
  addTangents(mesh, 2);
  addMorphs(mesh, 3, random.morphs);
  const StoredMesh stored(mesh, random.input);
  const Result<PackedMesh> packed = pack(stored.view(), random.joints);
  if (!packed) return packed.error();

  // Most targets are not active.
  std::vector<MorphWeight> morphs, previousMorphs;
  if (random.morphs > 0) {
    morphs = {{random.morphs / 2, 0.7f}, {0, random.morphs > 2 ? -0.4f : 0.0f}};
    if (random.morphs == 1) morphs.pop_back();
    previousMorphs = {{random.morphs - 1, 0.5f}};
  }
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t pose = 0; pose < 6; ++pose)
    poses.push_back(randomPose(10 + pose, random.joints, random.rigidity));
  std::vector<InstanceToVerify> instances;
  for (std::size_t instance = 0; instance < 3; ++instance) {
    InstanceToVerify& verified = instances.emplace_back();
    verified.packed = &*packed;
    verified.pose = poses[instance];
    verified.previousPose = poses[instance + 3];
    verified.morphs = morphs;
    verified.previousMorphs = previousMorphs;
    verified.method = random.method;
  }
  // One instance without active morph targets, next to two with them.
  instances[1].morphs = {};
  std::array<reference::SkinnedMesh, 6> expected;
  for (std::size_t instance = 0; instance < 3; ++instance) {
    InstanceToVerify& verified = instances[instance];
    const MeshView view = stored.view();
    Result<reference::SkinnedMesh> now =
        reference::skin(view, verified.pose, verified.method, verified.morphs);
    if (!now) return now.error();
    Result<reference::SkinnedMesh> before =
        reference::skin(view, verified.previousPose, verified.method, verified.previousMorphs);
    if (!before) return before.error();
    expected[instance] = std::move(*now);
    expected[instance + 3] = std::move(*before);
    verified.expected = &expected[instance];
    verified.expectedBefore = &expected[instance + 3];
    // All joints are finite, so every vertex has a defined result.
    verified.exemptions = {exemptionsOf(expected[instance]).onlyFinite, 0};
    verified.exemptionsBefore = {exemptionsOf(expected[instance + 3]).onlyFinite, 0};
  }
  return verifyBatch(target, instances, random.output, true);
}

}  // namespace dermis::samples
