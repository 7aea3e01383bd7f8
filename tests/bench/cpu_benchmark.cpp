// How fast the CPU path is, beside a plain loop and, where it was built with
// -DDERMIS_BENCH_OZZ=FOLDER, ozz-animation's SkinningJob (linear blending, by SIMD; it leaves
// normals unnormalized, and gets its palettes ready). All take turns in one process; the best round
// counts.
//
//   dermis_cpu_benchmark [VERTICES|MODEL [INSTANCES [ROUNDS]]]    10,000 vertices, 200 instances,
//   20
//
// A figure of 60 joints, four influences per vertex; or the first skin of a glTF file, whose
// instances are in different places of its first animation. Positions and normals in float32. The
// conversion of poses is part of what is measured.

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
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
  const AttributeView joints{first.joints.data(), count, sizeof(first), ComponentType::uint16, 4};
  const InfluenceSet set{joints, floatAttribute(first.weights.data(), count, 4, sizeof(first))};
  MeshView view;
  view.vertexCount = count;
  view.positions = floatAttribute(first.position.data(), count, 3, sizeof(first));
  view.normals = floatAttribute(first.normal.data(), count, 3, sizeof(first));
  view.tangents = floatAttribute(tangents.data(), count, 4);
  view.centersOfRotation = floatAttribute(centers.data(), count, 3);
  view.influenceSets = {&set, 1};
  return must(pack(view, crowd.jointCount()));
}

struct Scene {
  explicit Scene(samples::Crowd own)
      : crowd(std::move(own)),
        vertexCount(crowd.vertexCount()),
        instanceCount(crowd.instanceCount()),
        jointCount(crowd.jointCount()),
        output(crowd.vertices.size() * crowd.poses.size() * sizeof(Vertex) / sizeof(CacheLine) + 1),
        mesh(must(cpu::Mesh::create(packWhole(crowd)))) {}

  Vertex* outputOf(std::uint32_t instance) {
    return reinterpret_cast<Vertex*>(output.data()) + std::size_t{instance} * vertexCount;
  }

  samples::Crowd crowd;
  std::uint32_t vertexCount, instanceCount, jointCount;
  std::vector<CacheLine> output;
  cpu::Mesh mesh;
};

// -- Who takes part.

/// Skins instances `first` to `end`.
struct Contender {
  std::string name;
  std::function<void(std::uint32_t first, std::uint32_t end)> skin;
  std::function<void()> prepare = [] {};
  std::array<double, 2> best{1e9, 1e9};  ///< seconds, on one thread and on two
};

/// What Dermis is asked for. The quickest case is the default.
struct Case {
  Method method = Method::dualQuaternion;
  VertexLayout layout = {.normals = VertexFormat::float32x3};
  bool bounds = false;
  std::string name;  ///< of what is not the default
};

Contender dermisContender(Scene& scene, const Case& one, std::string_view target) {
  const VertexPlaces places = must(placeVertices(one.layout, scene.vertexCount));
  if (places.size * scene.instanceCount > scene.output.size() * sizeof(CacheLine))
    scene.output.resize(places.size * scene.instanceCount / sizeof(CacheLine) + 1);
  Contender contender;
  contender.name = "dermis " + std::string(methodName(one.method)) +
                   (one.name.empty() ? "" : ", " + one.name) + ", " + std::string(target);
  contender.prepare = [target] {
    if (!cpu::setTarget(target)) std::exit(1);
  };
  contender.skin = [&scene, one, places](std::uint32_t first, std::uint32_t end) {
    constexpr std::uint32_t together = 16;
    std::array<cpu::Instance, together> instances;
    std::array<InstanceResult, together> results;
    for (std::uint32_t i = first; i < end; i += together) {
      const std::uint32_t count = std::min(together, end - i);
      for (std::uint32_t k = 0; k < count; ++k) {
        instances[k].pose = scene.crowd.poses[i + k];
        instances[k].output =
            reinterpret_cast<std::byte*>(scene.output.data()) + places.size * (i + k);
        instances[k].box = {{-9, -9, -9}, {9, 9, 9}};
        if (one.bounds) instances[k].result = &results[k];
      }
      cpu::Job job;
      job.mesh = &scene.mesh;
      job.method = one.method;
      job.places = places;
      job.instances = std::span(instances).first(count);
      if (!cpu::skin(job)) std::exit(1);
    }
  };
  return contender;
}

/// What else engines ask for.
std::vector<Case> furtherCases() {
  using enum VertexFormat;
  const VertexLayout usual{.normals = float32x3};
  std::vector<Case> cases;
  for (const Method method : {Method::blended, Method::bulgeControlled, Method::centerOfRotation})
    cases.push_back({method, usual, false, {}});
  const auto add = [&](const VertexLayout& layout, bool bounds, const char* name) {
    cases.push_back({Method::dualQuaternion, layout, bounds, name});
  };
  add({}, false, "positions alone");
  add({.normals = float32x3, .tangents = float32x4}, false, "tangents");
  add({.normals = float32x3, .motion = true}, false, "previous positions");
  add({.normals = float32x3, .planar = true}, false, "planar");
  add(usual, true, "bounds");
  add({.positions = float32x4, .normals = octahedral16x2}, false, "float32x4 octahedral16x2");
  add({.positions = float16x4, .normals = octahedral8x2}, false, "float16x4 octahedral8x2");
  add({.positions = snorm16x4, .normals = snorm8x4}, false, "snorm16x4 snorm8x4");
  return cases;
}

/// As one writes it down: Kavan et al. 2007, section 4, vertex by vertex.
void skinPlainly(Scene& scene, std::uint32_t instance) {
  static thread_local std::vector<std::array<float, 8>> palette;
  palette.resize(scene.jointCount);
  for (std::uint32_t joint = 0; joint < scene.jointCount; ++joint) {
    const auto& m = scene.crowd.poses[instance][joint].m;
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
  Vertex* const output = scene.outputOf(instance);
  for (std::uint32_t v = 0; v < scene.vertexCount; ++v) {
    const samples::PlainVertex& vertex = scene.crowd.vertices[v];
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

Contender plainContender(Scene& scene) {
  Contender contender;
  contender.name = "a plain loop, dual quaternions";
  contender.skin = [&scene](std::uint32_t first, std::uint32_t end) {
    for (std::uint32_t i = first; i < end; ++i) skinPlainly(scene, i);
  };
  return contender;
}

#ifdef DERMIS_BENCH_OZZ
Contender ozzContender(Scene& scene) {
  struct alignas(16) Matrix {
    float columns[4][4];
  };
  std::vector<Matrix> palettes;
  for (const std::vector<JointMatrix>& pose : scene.crowd.poses) {
    for (const JointMatrix& joint : pose) {
      Matrix& to = palettes.emplace_back();
      for (std::size_t column = 0; column < 4; ++column) {
        for (std::size_t row = 0; row < 3; ++row) to.columns[column][row] = joint.m[row][column];
        to.columns[column][3] = column == 3 ? 1.0f : 0.0f;
      }
    }
  }
  std::vector<Vertex> bind;
  std::vector<std::uint16_t> joints;
  std::vector<float> weights;  // the last one is what is left of 1
  for (const samples::PlainVertex& vertex : scene.crowd.vertices) {
    Vertex& to = bind.emplace_back();
    std::ranges::copy(vertex.position, to.position);
    std::ranges::copy(vertex.normal, to.normal);
    joints.insert(joints.end(), vertex.joints.begin(), vertex.joints.end());
    weights.insert(weights.end(), vertex.weights.begin(), vertex.weights.end() - 1);
  }
  Contender contender;
  contender.name = "ozz-animation, linear";
  contender.skin = [&scene, palettes, bind, joints, weights](std::uint32_t first,
                                                             std::uint32_t end) {
    using ozz::span;
    const std::size_t vertices = scene.vertexCount;
    for (std::uint32_t i = first; i < end; ++i) {
      ozz::geometry::SkinningJob job;
      job.vertex_count = static_cast<int>(vertices);
      job.influences_count = 4;
      job.joint_matrices = span(reinterpret_cast<const ozz::math::Float4x4*>(
                                    palettes.data() + std::size_t{i} * scene.jointCount),
                                scene.jointCount);
      job.joint_indices = span(joints.data(), vertices * 4);
      job.joint_indices_stride = 8;
      job.joint_weights = span(weights.data(), weights.size());
      job.joint_weights_stride = 12;
      job.in_positions = span<const float>(bind[0].position, vertices * 6);
      job.in_normals = span<const float>(bind[0].normal, vertices * 6 - 3);
      Vertex* const output = scene.outputOf(i);
      job.out_positions = span<float>(output[0].position, vertices * 6);
      job.out_normals = span<float>(output[0].normal, vertices * 6 - 3);
      job.in_positions_stride = job.in_normals_stride = sizeof(Vertex);
      job.out_positions_stride = job.out_normals_stride = sizeof(Vertex);
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
  const std::string subject = argc > 1 ? argv[1] : "10000";
  const bool isNumber = std::ranges::all_of(subject, [](char c) { return c >= '0' && c <= '9'; });
  Scene scene(isNumber ? must(samples::longFigure(argument(1, 10'000), argument(2, 200)))
                       : must(samples::loadCrowd(subject, argument(2, 200))));
  std::vector<Contender> contenders;
#ifdef DERMIS_BENCH_OZZ
  contenders.push_back(ozzContender(scene));
#endif
  contenders.push_back(plainContender(scene));
  for (const Method method : {Method::dualQuaternion, Method::linear}) {
    for (const std::string_view target : cpu::targetNames()) {
      Case own;
      own.method = method;
      contenders.push_back(dermisContender(scene, own, target));
    }
  }
  const bool hasAll = argc > 4 && std::string(argv[4]) == "all";
  for (const Case& further : furtherCases()) {
    const std::size_t targets = hasAll ? cpu::targetNames().size() : 0;
    for (std::size_t target = 0; target < std::min<std::size_t>(targets, 2); ++target)
      contenders.push_back(dermisContender(scene, further, cpu::targetNames()[target]));
  }
  const std::uint32_t rounds = argument(3, 20);
  for (std::uint32_t round = 0; round < rounds; ++round) {
    for (Contender& contender : contenders) {
      contender.prepare();
      for (const bool onTwoThreads : {false, true}) {
        double& best = contender.best[onTwoThreads ? 1 : 0];
        best = std::min(best, secondsOf(contender, scene.instanceCount, onTwoThreads));
      }
    }
  }
  std::printf("%s: %u vertices, %u instances, %u joints; million vertices a second\n",
              scene.crowd.name.c_str(), scene.vertexCount, scene.instanceCount, scene.jointCount);
  std::printf("%-58s %9s %6s %9s %6s\n", "", "1 thread", "", "2 threads", "");
  const double vertices = 1e-6 * scene.vertexCount * scene.instanceCount;
  for (const Contender& contender : contenders) {
    std::printf("%-58s %9.0f %6.2f %9.0f %6.2f\n", contender.name.c_str(),
                vertices / contender.best[0], contenders[0].best[0] / contender.best[0],
                vertices / contender.best[1], contenders[0].best[1] / contender.best[1]);
  }
  return 0;
}
