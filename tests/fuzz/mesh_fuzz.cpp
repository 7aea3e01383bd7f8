// libFuzzer: random views of a mesh (formats, strides, counts, morph targets, any of them broken)
// through validate, repair, pack, fromBytes, the reference and the bounds, which must agree on what
// is good. Every array is as long as its view says and not a byte longer.

#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abi.h"
#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "kernel_reads.h"

using namespace dermis;
using fuzz::require;

namespace {

constexpr std::uint32_t mostJointsToSkin = 64;

class MeshMaker {
 public:
  explicit MeshMaker(FuzzedDataProvider& data) : data_(data) {}

  /// Valid while this object lives.
  MeshView make() {
    MeshView mesh;
    mesh.name = "fuzz";
    mesh.vertexCount = seldom() ? 0 : data_.ConsumeIntegralInRange<std::uint32_t>(1, 200);
    count_ = mesh.vertexCount;
    mesh.positions = attribute(positionTypes, 3, 4);
    if (seldom()) mesh.positions = {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (seldom()) mesh.positionScale[axis] = anyFloat();
      if (seldom()) mesh.positionOffset[axis] = anyFloat();
    }
    if (data_.ConsumeBool()) mesh.normals = attribute(directionTypes, 3, 4);
    if (data_.ConsumeBool()) mesh.tangents = attribute(directionTypes, 4, 4);
    if (data_.ConsumeBool()) mesh.centersOfRotation = attribute(centerTypes, 3, 3);
    if (data_.ConsumeBool()) mesh.dualQuaternionWeights = shares();
    if (data_.ConsumeBool()) mesh.bulgeStrengths = shares();
    if (seldom()) mesh.dualQuaternionWeight = anyFloat();
    if (seldom()) mesh.bulgeStrength = anyFloat();
    const std::size_t setCount = seldom() ? 0 : data_.ConsumeIntegralInRange<std::size_t>(1, 3);
    for (std::size_t i = 0; i < setCount; ++i) sets_.push_back(influenceSet());
    const auto targetCount = data_.ConsumeIntegralInRange<std::size_t>(0, 3);
    for (std::size_t i = 0; i < targetCount; ++i) targets_.push_back(morphTarget());
    mesh.influenceSets = sets_;
    mesh.morphTargets = targets_;
    return mesh;
  }

  std::uint32_t jointCount() {
    constexpr std::array<std::uint32_t, 4> odd{0, maxPoseJoints, maxPoseJoints + 1, 0xffffffffu};
    return seldom() ? data_.PickValueInArray(odd)
                    : data_.ConsumeIntegralInRange<std::uint32_t>(1, mostJointsToSkin);
  }

  /// Near the identity where the data has come to its end.
  std::vector<JointMatrix> pose(std::uint32_t jointCount) {
    std::vector<JointMatrix> pose(jointCount);
    for (JointMatrix& joint : pose) {
      for (auto& row : joint.m) {
        for (float& value : row) value = seldom() ? anyFloat() : value + smallFloat();
      }
    }
    return pose;
  }

  /// Weights from 0 to 1.
  std::vector<MorphWeight> morphs() {
    std::vector<MorphWeight> morphs;
    for (std::uint32_t target = 0; target < targets_.size(); ++target) {
      if (!seldom()) morphs.push_back({target, 1 - data_.ConsumeProbability<float>()});
    }
    return morphs;
  }

 private:
  using Types = std::span<const ComponentType>;
  static constexpr std::array allTypes{
      ComponentType::float32, ComponentType::float16, ComponentType::snorm8,
      ComponentType::snorm16, ComponentType::unorm8,  ComponentType::unorm16,
      ComponentType::uint8,   ComponentType::uint16,  ComponentType::uint32};
  static constexpr std::array positionTypes{ComponentType::float32, ComponentType::float16,
                                            ComponentType::snorm16, ComponentType::unorm16};
  static constexpr std::array directionTypes{ComponentType::float32, ComponentType::float16,
                                             ComponentType::snorm8, ComponentType::snorm16};
  static constexpr std::array displacementTypes{ComponentType::float32, ComponentType::float16,
                                                ComponentType::snorm16};
  static constexpr std::array centerTypes{ComponentType::float32};
  static constexpr std::array jointTypes{ComponentType::float32, ComponentType::uint8,
                                         ComponentType::uint16, ComponentType::uint32};
  static constexpr std::array weightTypes{ComponentType::float32, ComponentType::unorm8,
                                          ComponentType::unorm16};

  /// Never once the data has come to its end.
  bool seldom() { return data_.ConsumeIntegral<std::uint8_t>() > 247; }
  float smallFloat() { return static_cast<float>(data_.ConsumeIntegral<std::int8_t>()) / 64; }
  float anyFloat() {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    constexpr std::array<float, 10> odd{
        0,     -0.0f,  1,        1e-45f,    1e-38f,
        3e38f, -3e38f, infinity, -infinity, std::numeric_limits<float>::quiet_NaN()};
    return data_.PickValueInArray(odd);
  }

  AttributeView attribute(Types types, std::uint32_t fewest, std::uint32_t most) {
    AttributeView view;
    view.type = seldom() ? allTypes[data_.ConsumeIntegralInRange<std::size_t>(0, 8)]
                         : types[data_.ConsumeIntegralInRange<std::size_t>(0, types.size() - 1)];
    view.components = data_.ConsumeIntegralInRange<std::uint32_t>(fewest, most);
    if (seldom()) view.components = data_.ConsumeIntegralInRange<std::uint32_t>(0, 5);
    view.count = seldom() ? data_.ConsumeIntegralInRange<std::uint32_t>(0, 200) : count_;
    const std::uint32_t size = view.components * componentSize(view.type);
    view.stride = size + data_.ConsumeIntegralInRange<std::uint32_t>(0, 5);
    if (seldom()) view.stride = data_.ConsumeIntegralInRange<std::uint32_t>(0, size);
    const std::size_t bytes =
        view.count == 0 ? 0
                        : std::size_t{view.count - 1} * view.stride + std::min(size, view.stride);
    memory_.push_back(std::make_unique<std::byte[]>(bytes));
    view.data = memory_.back().get();
    fill({memory_.back().get(), bytes}, view.type);
    return view;
  }

  /// Some bytes, over and over; or, where they are floats, numbers of ordinary size.
  void fill(std::span<std::byte> bytes, ComponentType type) {
    std::vector<std::uint8_t> pattern;
    if (type == ComponentType::float32 && !seldom()) {
      const auto number = data_.ConsumeIntegralInRange<std::size_t>(1, 64);
      for (std::size_t i = 0; i < number; ++i) {
        const float value = smallFloat();
        const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
        pattern.insert(pattern.end(), first, first + sizeof(value));
      }
    } else {
      pattern = data_.ConsumeBytes<std::uint8_t>(data_.ConsumeIntegralInRange<std::size_t>(1, 128));
    }
    for (std::size_t i = 0; i < bytes.size() && !pattern.empty(); ++i)
      bytes[i] = static_cast<std::byte>(pattern[i % pattern.size()]);
  }

  /// Mostly from 0 to 1: bytes, or floats that are whole.
  AttributeView shares() {
    AttributeView view = attribute(weightTypes, 1, 1);
    if (view.type != ComponentType::float32 || view.components != 1 || view.stride < 4 || seldom())
      return view;
    const float share = data_.ConsumeBool() ? 1.0f : 0.0f;
    for (std::size_t element = 0; element < view.count; ++element)
      std::memcpy(memory_.back().get() + element * view.stride, &share, sizeof(share));
    return view;
  }

  InfluenceSet influenceSet() {
    InfluenceSet set;
    const auto slots = data_.ConsumeIntegralInRange<std::uint32_t>(1, 8);
    set.joints = attribute(jointTypes, slots, slots);
    set.weights = attribute(weightTypes, slots, slots);
    return set;
  }

  MorphTargetView morphTarget() {
    MorphTargetView target;
    const std::uint32_t all = count_;
    if (data_.ConsumeBool() && all > 0) {
      std::vector<std::uint32_t>& vertices = displaced_.emplace_back();
      for (std::uint32_t vertex = data_.ConsumeIntegralInRange<std::uint32_t>(0, all - 1);
           vertex < all; vertex += data_.ConsumeIntegralInRange<std::uint32_t>(1, 70))
        vertices.push_back(vertex);
      if (seldom()) vertices.back() = data_.ConsumeIntegralInRange<std::uint32_t>(0, 250);
      vertices.shrink_to_fit();
      target.vertices = vertices;
      count_ = static_cast<std::uint32_t>(vertices.size());
    }
    if (data_.ConsumeBool()) target.positions = attribute(displacementTypes, 3, 4);
    if (data_.ConsumeBool()) target.normals = attribute(directionTypes, 3, 4);
    if (data_.ConsumeBool()) target.tangents = attribute(directionTypes, 3, 4);
    for (float& scale : target.positionScale) {
      if (seldom()) scale = anyFloat();
    }
    count_ = all;
    return target;
  }

  FuzzedDataProvider& data_;
  std::uint32_t count_ = 0;  ///< of the elements of the next attribute
  std::vector<std::unique_ptr<std::byte[]>> memory_;
  std::vector<std::vector<std::uint32_t>> displaced_;
  std::vector<InfluenceSet> sets_;
  std::vector<MorphTargetView> targets_;
};

void checkReport(const MeshReport& report) {
  std::optional<MeshProblem> last;
  for (const MeshReport::Finding& finding : report.findings) {
    require(!last || finding.problem > *last);
    require(finding.count > 0);
    require(finding.message.starts_with("mesh 'fuzz'"));
    require(finding.message.find('\n') == std::string::npos);
    require(report.find(finding.problem) == &finding);
    last = finding.problem;
  }
}

void checkStored(const PackedMesh& packed) {
  const Result<PackedMesh> stored = PackedMesh::fromBytes(packed.bytes());
  require(stored.ok());
  require(std::ranges::equal(stored->bytes(), packed.bytes()));
  fuzz::KernelReads(*stored).readAll();
}

/// Mending what is good changes no attribute and no displacement.
void expectSameMorphs(const PackedMesh& one, const PackedMesh& other) {
  const fuzz::KernelReads a(one), b(other);
  for (std::uint32_t target = 0; target < one.info().morphTargetCount; ++target) {
    require(a.attributes(target) == b.attributes(target));
    const auto words = 3 * static_cast<std::uint32_t>(std::popcount(a.attributes(target)));
    for (std::uint32_t vertex = 0; vertex < one.vertexCount(); ++vertex) {
      const std::uint32_t inA = a.findDisplacement(target, vertex),
                          inB = b.findDisplacement(target, vertex);
      require((inA == 0) == (inB == 0));
      for (std::uint32_t word = 0; inA != 0 && word < words; ++word)
        require(a.floatAt(inA + word) == b.floatAt(inB + word));
    }
  }
}

/// Returns what `repair` makes of it, packed.
PackedMesh checkRepaired(const MeshView& mesh, std::uint32_t jointCount) {
  const Result<RepairedMesh> repaired = repair(mesh, jointCount);
  require(repaired.ok());
  const MeshView view = repaired->view();
  require(validate(view, jointCount).packable());
  Result<PackedMesh> packed = pack(view, jointCount);
  require(packed.ok());
  checkStored(*packed);
  require(packed->vertexCount() == mesh.vertexCount);
  require(packed->info().morphTargetCount == mesh.morphTargets.size());
  const Result<RepairedMesh> again = repair(view, jointCount);
  require(again.ok());
  const Result<PackedMesh> packedAgain = pack(again->view(), jointCount);
  require(packedAgain.ok() && std::ranges::equal(packedAgain->bytes(), packed->bytes()));
  return std::move(*packed);
}

/// The box holds what the reference makes of the mesh.
void checkBounds(const MeshView& mesh, const JointBounds& bounds, std::span<const JointMatrix> pose,
                 std::span<const MorphWeight> morphs) {
  for (const Method method : allMethods) {
    const Box box = skinnedBounds(bounds, pose, method);
    const Result<reference::SkinnedMesh> skinned = reference::skin(mesh, pose, method, morphs);
    require(skinned.ok() == (!needsCentersOfRotation(method) || mesh.centersOfRotation));
    if (!skinned) continue;
    for (const reference::Double3& position : skinned->positions) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        require(!std::isnan(box.min[axis]) && !std::isnan(box.max[axis]));
        if (!std::isfinite(position[axis])) continue;
        require(box.min[axis] <= position[axis] && position[axis] <= box.max[axis]);
      }
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  FuzzedDataProvider data(bytes, size);
  MeshMaker maker(data);
  const std::uint32_t jointCount = maker.jointCount();
  const MeshView mesh = maker.make();
  const MeshReport report = validate(mesh, jointCount);
  checkReport(report);

  const bool isPalette = jointCount >= 1 && jointCount <= maxPoseJoints;
  const Result<PackedMesh> packed = pack(mesh, jointCount);
  require(packed.ok() == (report.packable() && isPalette));
  const Result<JointBounds> bounds = jointBounds(mesh, jointCount);
  require(bounds.ok() == packed.ok());
  if (packed) checkStored(*packed);
  if (!report.repairable()) {
    require(!repair(mesh, jointCount).ok());
  } else if (isPalette) {
    const PackedMesh repaired = checkRepaired(mesh, jointCount);
    if (packed) expectSameMorphs(*packed, repaired);
  }

  if (jointCount > mostJointsToSkin || jointCount == 0) return 0;
  const std::vector<JointMatrix> pose = maker.pose(jointCount);
  const std::vector<MorphWeight> morphs = maker.morphs();
  require(reference::skin(mesh, pose, Method::linear, morphs).ok() == packed.ok());
  if (packed) checkBounds(mesh, *bounds, pose, morphs);
  return 0;
}
