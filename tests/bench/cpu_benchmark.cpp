// How fast the CPU path is, beside a plain loop and, where it was built with
// -DDERMIS_BENCH_OZZ=FOLDER, ozz-animation's SkinningJob (linear blending, by SIMD; it leaves
// normals unnormalized, and gets its palettes ready). All take turns in one process; the best round
// counts.
//
//   dermis_cpu_benchmark [VERTICES|MODEL [INSTANCES [ROUNDS [FILTER]]]]   10,000 vertices, 200
//   instances, 20
//
// A figure of 60 joints, four influences per vertex; or the first skin of a glTF file, whose
// instances are in different places of its first animation. Positions and normals in float32,
// unless a row says otherwise. The conversion of poses is part of what is measured. Rows with
// tangents, or with positions alone, are compared with ozz-animation's job for the same attributes.
// With morph targets, a twentieth of the mesh is displaced by each of 200 targets, of which 30 are
// active on each instance. FILTER: only rows whose names contain it.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "dermis/cpu.h"
#include "dermis/mesh.h"
#include "kit/bench/crowd.h"
#include "kit/random_rig.h"

#ifdef DERMIS_BENCH_OZZ
#include "ozz/base/maths/simd_math.h"
#include "ozz/geometry/runtime/skinning_job.h"
#endif

namespace {

using namespace dermis;

template <typename T>
T must(Result<T> result) {
  if (result) return *std::move(result);
  std::fprintf(stderr, "dermis_cpu_benchmark: error: %s\n", result.error().message.c_str());
  std::exit(1);
}

struct Vertex {
  float position[3], normal[3];
};

constexpr std::uint32_t morphTargets = 200, activeTargets = 30;

/// Output begins where engines let buffers begin.
struct alignas(64) CacheLine {
  std::byte bytes[64];
};

/// With everything that a method or a layout may want.
PackedMesh packWhole(const samples::Crowd& crowd) {
  const samples::PlainVertex& first = crowd.vertices.front();
  const std::uint32_t count = crowd.vertexCount();
  std::vector<float> tangents, centers;
  for (const samples::PlainVertex& vertex : crowd.vertices) {
    const auto& n = vertex.normal;
    tangents.insert(tangents.end(), {n[1], n[2], n[0], 1});
    for (const float coordinate : vertex.position) centers.push_back(coordinate / 2);
  }
  std::vector<std::array<float, 3>> displacements(count, {0.01f, -0.02f, 0.015f});
  std::vector<std::uint32_t> vertices(count);
  std::iota(vertices.begin(), vertices.end(), 0u);
  std::vector<MorphTargetView> targets(morphTargets);
  const std::uint32_t size = count / 20;
  for (std::uint32_t number = 0; number < morphTargets; ++number) {
    MorphTargetView& target = targets[number];
    target.vertices = std::span(vertices).subspan((count - size) / morphTargets * number, size);
    target.positions = attributeView(displacements[0].data(), size, 3);
    target.normals = target.positions;
  }
  const AttributeView joints{first.joints.data(), count, sizeof(first), ComponentType::uint16, 4};
  const InfluenceSet set{joints, attributeView(first.weights.data(), count, 4, sizeof(first))};
  MeshView view;
  view.vertexCount = count;
  view.positions = attributeView(first.position.data(), count, 3, sizeof(first));
  view.normals = attributeView(first.normal.data(), count, 3, sizeof(first));
  view.tangents = attributeView(tangents.data(), count, 4);
  view.centersOfRotation = attributeView(centers.data(), count, 3);
  view.influenceSets = {&set, 1};
  view.morphTargets = targets;
  return must(pack(view, crowd.jointCount()));
}

struct Subject {
  explicit Subject(samples::Crowd own)
      : crowd(std::move(own)),
        vertexCount(crowd.vertexCount()),
        instanceCount(crowd.instanceCount()),
        jointCount(crowd.jointCount()),
        output(crowd.vertices.size() * crowd.poses.size() * sizeof(Vertex) / sizeof(CacheLine) + 1),
        mesh(must(cpu::Mesh::create(packWhole(crowd)))) {
    for (std::uint32_t number = 0; number < activeTargets; ++number)
      morphs.push_back({number * (morphTargets / activeTargets), 0.25f});
  }

  Vertex* outputOf(std::uint32_t instance) {
    return reinterpret_cast<Vertex*>(output.data()) + std::size_t{instance} * vertexCount;
  }

  samples::Crowd crowd;
  std::uint32_t vertexCount, instanceCount, jointCount;
  std::vector<CacheLine> output;
  cpu::Mesh mesh;
  std::vector<MorphWeight> morphs;
};

// -- Who takes part.

enum class Attributes : std::uint8_t { positions, normals, tangents };

/// Skins instances `first` to `end`.
struct Contender {
  std::string name;
  Attributes attributes = Attributes::normals;  ///< the last that it skins
  std::function<void(std::uint32_t first, std::uint32_t end)> skin;
  std::function<void()> prepare = [] {};
  std::array<double, 2> best{1e9, 1e9};  ///< seconds, on one thread and on two
};

/// What Dermis is asked for. The quickest case is the default.
struct Case {
  Method method = Method::dualQuaternion;
  VertexLayout layout = {.normals = VertexFormat::float32x3};
  bool bounds = false, morphs = false;
  std::string name;  ///< of what is not the default
};

Contender dermisContender(Subject& subject, const Case& one, std::string_view target) {
  const VertexPlaces places = must(placeVertices(one.layout, subject.vertexCount));
  if (places.size * subject.instanceCount > subject.output.size() * sizeof(CacheLine))
    subject.output.resize(places.size * subject.instanceCount / sizeof(CacheLine) + 1);
  Contender contender;
  contender.attributes = one.layout.tangents != VertexFormat::none  ? Attributes::tangents
                         : one.layout.normals != VertexFormat::none ? Attributes::normals
                                                                    : Attributes::positions;
  contender.name = "dermis " + std::string(methodName(one.method)) +
                   (one.name.empty() ? "" : ", " + one.name) + ", " + std::string(target);
  contender.prepare = [target] {
    if (!cpu::setTarget(target)) std::exit(1);
  };
  contender.skin = [&subject, one, places](std::uint32_t first, std::uint32_t end) {
    constexpr std::uint32_t together = 16;
    std::array<cpu::Instance, together> instances;
    std::array<InstanceResult, together> results;
    for (std::uint32_t i = first; i < end; i += together) {
      const std::uint32_t count = std::min(together, end - i);
      for (std::uint32_t k = 0; k < count; ++k) {
        instances[k].pose = subject.crowd.poses[i + k];
        instances[k].output.fill(reinterpret_cast<std::byte*>(subject.output.data()) +
                                 places.size * (i + k));
        instances[k].box = {{-9, -9, -9}, {9, 9, 9}};
        if (one.bounds) instances[k].result = &results[k];
        if (one.morphs) instances[k].morphs = subject.morphs;
      }
      cpu::Job job;
      job.mesh = &subject.mesh;
      job.method = one.method;
      job.places = places;
      job.instances = std::span(instances).first(count);
      if (!cpu::skin(job)) std::exit(1);
    }
  };
  return contender;
}

/// The quickest cases, and what else engines ask for.
std::vector<Case> allCases() {
  using enum VertexFormat;
  const VertexLayout usual{.normals = float32x3},
      tangents{.normals = float32x3, .tangents = float32x4};
  std::vector<Case> cases;
  for (const Method method : {Method::dualQuaternion, Method::linear, Method::blended,
                              Method::bulgeControlled, Method::centerOfRotation})
    cases.push_back({.method = method, .layout = usual, .name = {}});
  const auto add = [&](const VertexLayout& layout, const char* name) {
    cases.push_back({.layout = layout, .name = name});
  };
  add({}, "positions alone");
  add(tangents, "tangents");
  add({.normals = float32x3, .motion = true}, "previous positions");
  add({.normals = float32x3, .planar = true}, "planar");
  add({.positions = float32x4, .normals = octahedral16x2}, "float32x4 octahedral16x2");
  add({.positions = float16x4, .normals = octahedral16x2}, "float16x4 octahedral16x2");
  add({.positions = snorm16x4, .normals = snorm8x4}, "snorm16x4 snorm8x4");
  cases.push_back({.layout = usual, .bounds = true, .name = "bounds"});
  cases.push_back({.layout = usual, .morphs = true, .name = "30 of 200 morph targets"});
  cases.push_back({.method = Method::linear, .layout = tangents, .name = "tangents"});
  return cases;
}

/// As one writes it down: Kavan et al. 2007, section 4, vertex by vertex.
void skinPlainly(Subject& subject, std::uint32_t instance) {
  static thread_local std::vector<std::array<float, 8>> palette;
  palette.resize(subject.jointCount);
  for (std::uint32_t joint = 0; joint < subject.jointCount; ++joint) {
    const auto& m = subject.crowd.poses[instance][joint].m;
    std::array<float, 8>& q = palette[joint];
    // A column of the largest square (Shepperd 1978).
    const float squares[4] = {1 + m[0][0] - m[1][1] - m[2][2], 1 - m[0][0] + m[1][1] - m[2][2],
                              1 - m[0][0] - m[1][1] + m[2][2], 1 + m[0][0] + m[1][1] + m[2][2]};
    const auto largest = std::max_element(squares, squares + 4) - squares;
    const float a = m[2][1] - m[1][2], b = m[0][2] - m[2][0], c = m[1][0] - m[0][1];
    const float d = m[0][1] + m[1][0], e = m[0][2] + m[2][0], f = m[1][2] + m[2][1];
    const float columns[4][4] = {
        {squares[0], d, e, a}, {d, squares[1], f, b}, {e, f, squares[2], c}, {a, b, c, squares[3]}};
    const float scale = 0.5f / std::sqrt(squares[largest]);
    for (std::size_t k = 0; k < 4; ++k) q[k] = columns[largest][k] * scale;
    const float x = m[0][3], y = m[1][3], z = m[2][3];
    q[4] = 0.5f * (q[3] * x + y * q[2] - z * q[1]);
    q[5] = 0.5f * (q[3] * y + z * q[0] - x * q[2]);
    q[6] = 0.5f * (q[3] * z + x * q[1] - y * q[0]);
    q[7] = -0.5f * (x * q[0] + y * q[1] + z * q[2]);
  }
  Vertex* const output = subject.outputOf(instance);
  for (std::uint32_t v = 0; v < subject.vertexCount; ++v) {
    const samples::PlainVertex& vertex = subject.crowd.vertices[v];
    const std::uint16_t* const joints = vertex.joints.data();
    const std::array<float, 8>& pivot = palette[joints[0]];
    std::array<float, 8> q{};
    for (std::size_t k = 0; k < 4; ++k) {
      const std::array<float, 8>& joint = palette[joints[k]];
      const float dot =
          pivot[0] * joint[0] + pivot[1] * joint[1] + pivot[2] * joint[2] + pivot[3] * joint[3];
      const float weight = std::copysign(vertex.weights[k], dot);
      for (std::size_t i = 0; i < 8; ++i) q[i] += weight * joint[i];
    }
    const float factor = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const auto turned = [&](const float* p, const float* shift, float dual, float* to) {
      const float x = q[1] * p[2] - q[2] * p[1] + q[3] * p[0] + shift[0];
      const float y = q[2] * p[0] - q[0] * p[2] + q[3] * p[1] + shift[1];
      const float z = q[0] * p[1] - q[1] * p[0] + q[3] * p[2] + shift[2];
      to[0] = p[0] + factor * (q[1] * z - q[2] * y + q[3] * shift[0] - dual * q[0]);
      to[1] = p[1] + factor * (q[2] * x - q[0] * z + q[3] * shift[1] - dual * q[1]);
      to[2] = p[2] + factor * (q[0] * y - q[1] * x + q[3] * shift[2] - dual * q[2]);
    };
    constexpr float none[3] = {0, 0, 0};
    turned(vertex.position.data(), &q[4], q[7], output[v].position);
    turned(vertex.normal.data(), none, 0, output[v].normal);
  }
}

Contender plainContender(Subject& subject) {
  Contender contender;
  contender.name = "a plain loop, dual quaternions";
  contender.skin = [&subject](std::uint32_t first, std::uint32_t end) {
    for (std::uint32_t i = first; i < end; ++i) skinPlainly(subject, i);
  };
  return contender;
}

#ifdef DERMIS_BENCH_OZZ
Contender ozzContender(Subject& subject, Attributes attributes) {
  struct alignas(16) Matrix {
    float columns[4][4];
  };
  std::vector<Matrix> palettes;
  for (const std::vector<JointMatrix>& pose : subject.crowd.poses) {
    for (const JointMatrix& joint : pose) {
      Matrix& to = palettes.emplace_back();
      for (std::size_t column = 0; column < 4; ++column) {
        for (std::size_t row = 0; row < 3; ++row) to.columns[column][row] = joint.m[row][column];
        to.columns[column][3] = column == 3 ? 1.0f : 0.0f;
      }
    }
  }
  // Positions, normals and tangents side by side.
  const std::size_t floats = 3 * (static_cast<std::size_t>(attributes) + 1);
  std::vector<float> bind;
  std::vector<std::uint16_t> joints;
  std::vector<float> weights;  // the last one is what is left of 1
  for (const samples::PlainVertex& vertex : subject.crowd.vertices) {
    const auto& n = vertex.normal;
    const float all[9] = {vertex.position[0],
                          vertex.position[1],
                          vertex.position[2],
                          n[0],
                          n[1],
                          n[2],
                          n[1],
                          n[2],
                          n[0]};
    bind.insert(bind.end(), all, all + floats);
    joints.insert(joints.end(), vertex.joints.begin(), vertex.joints.end());
    weights.insert(weights.end(), vertex.weights.begin(), vertex.weights.end() - 1);
  }
  Contender contender;
  contender.attributes = attributes;
  constexpr const char* names[] = {"positions alone", "positions and normals", "with tangents"};
  contender.name =
      std::string("ozz-animation, linear, ") + names[static_cast<std::size_t>(attributes)];
  contender.skin = [=, &subject](std::uint32_t first, std::uint32_t end) {
    using ozz::span;
    const std::size_t vertices = subject.vertexCount, stride = floats * sizeof(float);
    for (std::uint32_t i = first; i < end; ++i) {
      ozz::geometry::SkinningJob job;
      job.vertex_count = static_cast<int>(vertices);
      job.influences_count = 4;
      job.joint_matrices = span(reinterpret_cast<const ozz::math::Float4x4*>(
                                    palettes.data() + std::size_t{i} * subject.jointCount),
                                subject.jointCount);
      job.joint_indices = span(joints.data(), vertices * 4);
      job.joint_indices_stride = 8;
      job.joint_weights = span(weights.data(), weights.size());
      job.joint_weights_stride = 12;
      float* const output = reinterpret_cast<float*>(subject.output.data()) + vertices * floats * i;
      const auto from = [&](std::size_t offset) {
        return span<const float>(bind.data() + offset, vertices * floats - offset);
      };
      const auto to = [&](std::size_t offset) {
        return span<float>(output + offset, vertices * floats - offset);
      };
      job.in_positions = from(0);
      job.out_positions = to(0);
      job.in_positions_stride = job.out_positions_stride = stride;
      if (attributes >= Attributes::normals) {
        job.in_normals = from(3);
        job.out_normals = to(3);
        job.in_normals_stride = job.out_normals_stride = stride;
      }
      if (attributes == Attributes::tangents) {
        job.in_tangents = from(6);
        job.out_tangents = to(6);
        job.in_tangents_stride = job.out_tangents_stride = stride;
      }
      if (!job.Run()) std::exit(1);
    }
  };
  return contender;
}
#endif

double secondsOf(const Contender& contender, std::uint32_t instances, bool onTwoThreads) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  if (onTwoThreads) {
    std::thread other([&] { contender.skin(instances / 2, instances); });
    contender.skin(0, instances / 2);
    other.join();
  } else {
    contender.skin(0, instances);
  }
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace

int main(int argc, char** argv) {
  const auto argument = [&](int index, int otherwise) {
    return static_cast<std::uint32_t>(argc > index ? std::max(std::atoi(argv[index]), 1)
                                                   : otherwise);
  };
  const std::string model = argc > 1 ? argv[1] : "10000";
  const bool isNumber = std::ranges::all_of(model, [](char c) { return c >= '0' && c <= '9'; });
  Subject subject(isNumber ? must(samples::longFigure(argument(1, 10'000), argument(2, 200)))
                           : must(samples::loadCrowd(model, argument(2, 200))));
  std::vector<Contender> contenders;
#ifdef DERMIS_BENCH_OZZ
  for (const Attributes attributes :
       {Attributes::normals, Attributes::positions, Attributes::tangents})
    contenders.push_back(ozzContender(subject, attributes));
#endif
  contenders.push_back(plainContender(subject));
  for (const std::string_view target : cpu::targetNames()) {
    for (const Case& one : allCases()) contenders.push_back(dermisContender(subject, one, target));
  }
  const std::string filter = argc > 4 ? argv[4] : "";
  std::erase_if(contenders, [&](const Contender& contender) {
    return contender.name.find(filter) == std::string::npos && contender.name.starts_with("dermis");
  });
  const std::uint32_t rounds = argument(3, 20);
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (Contender& contender : contenders) {
      contender.prepare();
      for (const bool onTwoThreads : {false, true}) {
        double& best = contender.best[onTwoThreads ? 1 : 0];
        best = std::min(best, secondsOf(contender, subject.instanceCount, onTwoThreads));
      }
    }
  }
  std::printf("%s: %u vertices, %u instances, %u joints; million vertices a second\n",
              subject.crowd.name.c_str(), subject.vertexCount, subject.instanceCount,
              subject.jointCount);
  std::printf("%-70s %9s %6s %9s %6s\n", "", "1 thread", "", "2 threads", "");
  const double vertices = 1e-6 * subject.vertexCount * subject.instanceCount;
  for (const Contender& contender : contenders) {
    const auto baseline =
        std::ranges::find(contenders, contender.attributes, &Contender::attributes);
    const Contender& other = baseline == contenders.end() ? contenders[0] : *baseline;
    std::printf("%-70s %9.0f %6.2f %9.0f %6.2f\n", contender.name.c_str(),
                vertices / contender.best[0], other.best[0] / contender.best[0],
                vertices / contender.best[1], other.best[1] / contender.best[1]);
  }
  return 0;
}
