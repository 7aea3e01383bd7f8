#include "dermis/cpu.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "abi.h"
#include "cpu/mesh_data.h"
#include "cpu/morph.h"
#include "strict_floating_point.h"

namespace dermis::cpu {
namespace {

constexpr std::uint32_t mostInfluences = 512;
/// Limits a section so that its dual quaternions stay in the cache for four instances at a time.
constexpr std::size_t sectionPairs = 1024;
static_assert(blockVertices * mostInfluences <= 65536 / indexScale);

/// Reads a packed mesh. Its contents were checked when it was made.
class Reader {
 public:
  explicit Reader(const PackedMesh& packed)
      : words_(reinterpret_cast<const std::uint32_t*>(packed.bytes().data()),
               packed.bytes().size() / 4),
        header(abi::load<abi::MeshHeader>(words_, 0)) {}

  std::span<const std::uint32_t> words() const { return words_; }
  float word(std::uint32_t section, std::size_t vertex, std::uint32_t component,
             std::uint32_t stride = abi::VERTEX_WORDS) const {
    return std::bit_cast<float>(words_[section + vertex * stride + component]);
  }
  std::vector<abi::InfluenceRecord> influences(std::uint32_t vertex) const {
    const auto begin = abi::load<abi::PositionRecord>(
        words_, header.positions + std::size_t{vertex} * abi::VERTEX_WORDS);
    const auto end = abi::load<abi::PositionRecord>(
        words_, header.positions + (std::size_t{vertex} + 1) * abi::VERTEX_WORDS);
    const std::uint32_t count =
        (end.influences / 2 - begin.influences / 2) * 2 - begin.influences % 2;
    std::vector<abi::InfluenceRecord> all;
    for (std::uint32_t slot = 0; slot < count; ++slot) {
      all.push_back(abi::load<abi::InfluenceRecord>(
          words_, header.influences + std::size_t{begin.influences / 2} * 4 +
                      std::size_t{slot} * abi::INFLUENCE_WORDS));
    }
    return all;
  }

 private:
  std::span<const std::uint32_t> words_;

 public:
  abi::MeshHeader header;
};

std::vector<Lanes> lanesOf(const Reader& reader, std::uint32_t section, std::uint32_t components,
                           std::uint32_t stride = abi::VERTEX_WORDS) {
  const std::uint32_t count = reader.header.vertexCount;
  std::vector<Lanes> lanes(std::size_t{(count + blockVertices - 1) / blockVertices} * components);
  for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
    for (std::uint32_t component = 0; component < components; ++component) {
      lanes[std::size_t{vertex / blockVertices} * components + component]
          .v[vertex % blockVertices] = reader.word(section, vertex, component, stride);
    }
  }
  return lanes;
}

/// One number per vertex, or `all` for every vertex if there is no such section.
std::vector<Lanes> sharesOf(const Reader& reader, std::uint32_t section, float all) {
  if (section != 0) return lanesOf(reader, section, 1, 1);
  Lanes lanes;
  std::ranges::fill(lanes.v, all);
  return std::vector<Lanes>((reader.header.vertexCount + blockVertices - 1) / blockVertices, lanes);
}

/// Gives the same bits as `unitOr` of the kernels, which normalizes vertices after morphing.
std::array<float, 3> unitOrZero(float x, float y, float z) {
  const float given = x * x + y * y + z * z;
  const bool isModerate = given >= 0x1p-60f && given <= 0x1p60f;
  const float largest = std::max(std::abs(x), std::max(std::abs(y), std::abs(z)));
  const std::uint32_t exponent = std::bit_cast<std::uint32_t>(largest) >> 23;
  const float scale = isModerate ? 1 : std::bit_cast<float>((253 - std::min(exponent, 252u)) << 23);
  x *= scale;
  y *= scale;
  z *= scale;
  const float square = x * x + y * y + z * z;
  if (square == 0) return {0, 0, 0};
  const float inverse = 1 / std::sqrt(square);
  return {x * inverse, y * inverse, z * inverse};
}

/// Normalizes directions. A fourth component, the handedness, becomes 1 or -1.
void makeUnit(std::vector<Lanes>& lanes, std::size_t components) {
  for (std::size_t block = 0; block < lanes.size(); block += components) {
    for (std::uint32_t lane = 0; lane < blockVertices; ++lane) {
      const std::array<float, 3> unit =
          unitOrZero(lanes[block].v[lane], lanes[block + 1].v[lane], lanes[block + 2].v[lane]);
      for (std::size_t component = 0; component < 3; ++component)
        lanes[block + component].v[lane] = unit[component];
      if (components < 4) continue;
      float& hand = lanes[block + 3].v[lane];
      hand = hand < 0 ? -1.0f : 1.0f;
    }
  }
}

/// Builds the lists of joints and pairs of sections, and the slots of vertices.
class Slots {
 public:
  explicit Slots(MeshData& data) : data_(data) {}

  /// Adds a block.
  void add(std::span<const std::vector<abi::InfluenceRecord>> vertices) {
    std::size_t most = 1, all = 0;
    for (const auto& vertex : vertices) {
      most = std::max(most, vertex.size());
      all += std::max(vertex.size(), std::size_t{1});
    }
    if (pairs_.size() + all > sectionPairs) endSection();
    if (data_.runs.empty() || isNewSection_ || data_.runs.back().influences != most) {
      const auto section = static_cast<std::uint32_t>(data_.sections.size());
      data_.runs.push_back(
          {section, block_, block_, static_cast<std::uint32_t>(most), data_.weights.size()});
      isNewSection_ = false;
    }
    for (const auto& vertex : vertices) addVertex(vertex, most);
    data_.runs.back().blockEnd = ++block_;
  }

  void endSection() {
    if (joints_.empty()) return;
    sortJoints();
    Section section;
    section.firstJoint = firstJoint_;
    section.firstPair = firstPair_;
    section.jointEnd = firstJoint_ = static_cast<std::uint32_t>(data_.joints.size());
    section.pairEnd = firstPair_ = static_cast<std::uint32_t>(data_.pairs.size());
    data_.sections.push_back(section);
    firstSlot_ = data_.weights.size();
    joints_.clear();
    pairs_.clear();
    isNewSection_ = true;
  }

 private:
  /// Sorts joints so that poses are read mostly in memory order.
  void sortJoints() {
    std::vector<std::uint16_t> numbers(joints_.size());
    std::uint16_t next = 0;
    for (const auto& [joint, number] : joints_) {  // in ascending order
      data_.joints[std::size_t{firstJoint_} + next] = joint;
      numbers[number] = next++;
    }
    for (std::size_t pair = firstPair_; pair < data_.pairs.size(); ++pair) {
      Pair& own = data_.pairs[pair];
      own = {numbers[own.pivot], numbers[own.joint]};
    }
    for (std::size_t slot = firstSlot_; slot < data_.jointNumbers.size(); ++slot) {
      std::uint16_t& own = data_.jointNumbers[slot];
      own = static_cast<std::uint16_t>(numbers[own / indexScale] * indexScale);
    }
  }
  std::uint16_t jointNumber(std::uint32_t joint) {
    const auto [found, isNew] =
        joints_.try_emplace(joint, static_cast<std::uint16_t>(joints_.size()));
    if (isNew) data_.joints.push_back(joint);
    return found->second;
  }
  std::uint16_t pairNumber(Pair pair) {
    const auto [found, isNew] =
        pairs_.try_emplace({pair.pivot, pair.joint}, static_cast<std::uint16_t>(pairs_.size()));
    if (isNew) data_.pairs.push_back(pair);
    return found->second;
  }
  void addVertex(const std::vector<abi::InfluenceRecord>& influences, std::size_t slots) {
    const std::uint16_t pivot = jointNumber(influences.empty() ? stillJoint : influences[0].joint);
    for (std::size_t slot = 0; slot < slots; ++slot) {
      const bool isUsed = slot < influences.size();
      const std::uint16_t joint = isUsed ? jointNumber(influences[slot].joint) : pivot;
      const float still = influences.empty() && slot == 0 ? 1.0f : 0.0f;
      data_.weights.push_back(isUsed ? influences[slot].weight : still);
      data_.jointNumbers.push_back(static_cast<std::uint16_t>(joint * indexScale));
      data_.pairNumbers.push_back(
          static_cast<std::uint16_t>(pairNumber({pivot, joint}) * indexScale));
    }
  }

  MeshData& data_;
  std::map<std::uint32_t, std::uint16_t> joints_;
  std::map<std::pair<std::uint16_t, std::uint16_t>, std::uint16_t> pairs_;
  std::uint32_t block_ = 0, firstJoint_ = 0, firstPair_ = 0;
  std::size_t firstSlot_ = 0;
  bool isNewSection_ = true;
};

}  // namespace

std::uint32_t MeshData::runOf(std::uint32_t block) const {
  const auto after =
      std::ranges::upper_bound(runs, block, {}, [](const Run& run) { return run.firstBlock; });
  return static_cast<std::uint32_t>(after - runs.begin()) - 1;
}

std::vector<abi::InfluenceRecord> MeshData::influencesOf(std::uint32_t vertex) const {
  const Run& run = runs[runOf(vertex / blockVertices)];
  const std::size_t first =
      run.slotOf(vertex / blockVertices) + std::size_t{vertex % blockVertices} * run.influences;
  std::vector<abi::InfluenceRecord> all;
  for (std::size_t slot = first; slot < first + run.influences; ++slot) {
    const std::uint32_t joint =
        joints[sections[run.section].firstJoint + jointNumbers[slot] / indexScale];
    if (weights[slot] != 0 && joint != stillJoint) all.push_back({weights[slot], joint});
  }
  return all;
}

MeshData MeshData::select(std::span<const std::uint32_t> vertices,
                          std::span<const MorphWeight> morphs) const {
  MeshData selected;
  const std::size_t blocks = (vertices.size() + blockVertices - 1) / blockVertices;
  selected.positions.resize(blocks * 3);
  const auto copy = [&](const std::vector<Lanes>& from, std::size_t components,
                        std::vector<Lanes>& to) {
    if (from.empty()) return;
    to.resize(blocks * components);
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      for (std::size_t k = 0; k < components; ++k) {
        to[i / blockVertices * components + k].v[i % blockVertices] =
            from[vertices[i] / blockVertices * components + k].v[vertices[i] % blockVertices];
      }
    }
  };
  copy(centers, 3, selected.centers);
  copy(dualQuaternionWeights, 1, selected.dualQuaternionWeights);
  copy(bulgeStrengths, 1, selected.bulgeStrengths);
  Slots slots(selected);
  std::array<std::vector<abi::InfluenceRecord>, blockVertices> influences;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::uint32_t vertex = vertices[i], block = vertex / blockVertices;
    Lanes displaced[3];
    std::copy_n(positions.data() + std::size_t{block} * 3, 3, displaced);
    for (const MorphWeight& morph : morphs) {
      if (morph.weight == 0) continue;
      const ActiveTarget target = activeTarget(*this, morph);
      const auto found = displacementsOf(*this, target, vertex / abi::MORPH_BLOCK_VERTICES);
      if (found) displace(partOf(*found, block), *found, displaced, nullptr, nullptr);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      selected.positions[i / blockVertices * 3 + axis].v[i % blockVertices] =
          displaced[axis].v[vertex % blockVertices];
    }
    influences[i % blockVertices] = influencesOf(vertex);
    if ((i + 1) % blockVertices != 0 && i + 1 != vertices.size()) continue;
    slots.add(influences);
    for (auto& lane : influences) lane.clear();
  }
  slots.endSection();
  return selected;
}

Mesh::Mesh(std::unique_ptr<const MeshData> data) : data_(std::move(data)) {}
Mesh::~Mesh() = default;
Mesh::Mesh(Mesh&&) noexcept = default;
Mesh& Mesh::operator=(Mesh&&) noexcept = default;

const MeshInfo& Mesh::info() const {
  return data_->info;
}

Result<Mesh> Mesh::create(const PackedMesh& packed) {
  auto data = std::make_unique<MeshData>();
  data->info = packed.info();
  if (data->info.maxInfluences > mostInfluences) {
    return Error{ErrorCode::limitExceeded, "a vertex has " +
                                               std::to_string(data->info.maxInfluences) +
                                               " influences, but the CPU path supports at most " +
                                               std::to_string(mostInfluences)};
  }
  const Reader reader(packed);
  const abi::MeshHeader& header = reader.header;
  const std::uint32_t blocks = (header.vertexCount + blockVertices - 1) / blockVertices;
  data->positions = lanesOf(reader, header.positions, 3);
  if (header.normals != 0) {
    data->givenNormals = lanesOf(reader, header.normals, 3);
    data->normals = data->givenNormals;
    makeUnit(data->normals, 3);
  }
  if (header.tangents != 0) {
    data->givenTangents = lanesOf(reader, header.tangents, 4);
    data->tangents = data->givenTangents;
    makeUnit(data->tangents, 4);
  }
  if (header.centers != 0) data->centers = lanesOf(reader, header.centers, 3);
  data->dualQuaternionWeights =
      sharesOf(reader, header.dualQuaternionWeights, header.dualQuaternionWeight);
  data->bulgeStrengths = sharesOf(reader, header.bulgeStrengths, header.bulgeStrength);
  if (header.morphCount != 0) data->packed.assign(reader.words().begin(), reader.words().end());

  Slots slots(*data);
  std::array<std::vector<abi::InfluenceRecord>, blockVertices> vertices;
  for (std::uint32_t block = 0; block < blocks; ++block) {
    for (std::uint32_t lane = 0; lane < blockVertices; ++lane) {
      const std::uint32_t vertex = block * blockVertices + lane;
      vertices[lane].clear();
      if (vertex < header.vertexCount) vertices[lane] = reader.influences(vertex);
    }
    slots.add(vertices);
  }
  slots.endSection();
  return Mesh(std::move(data));
}

}  // namespace dermis::cpu
