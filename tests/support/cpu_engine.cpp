#include "cpu_engine.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace dermis::test {

std::vector<std::byte> skinOne(const PackedMesh& mesh, Method method, const VertexLayout& layout,
                               cpu::Instance instance) {
  const cpu::Mesh made = must(cpu::Mesh::create(mesh));
  cpu::Job job;
  job.mesh = &made;
  job.method = method;
  job.places = must(placeVertices(layout, mesh.vertexCount()));
  std::vector<std::byte> bytes(job.places.size);
  instance.output.fill(bytes.data());
  job.instances = {&instance, 1};
  must(cpu::skin(job));
  return bytes;
}

CpuEngine::CpuEngine(const SceneDescription& description, std::span<std::byte> output)
    : runner_(must(cpu::SceneRunner::create(description, output))) {}

MeshHandle CpuEngine::addMesh(const PackedMesh& mesh) {
  const MeshHandle handle = must(scene().addMesh(mesh));
  vertexCounts_[{handle.index, handle.generation}] = mesh.vertexCount();
  return handle;
}

void CpuEngine::writePose(PoseHandle pose, std::span<const JointMatrix> matrices) {
  const std::span<JointMatrix> to = must(scene().writePose(pose));
  if (to.size() != matrices.size()) throw std::runtime_error("the pose has another size");
  std::ranges::copy(matrices, to.begin());
}

void CpuEngine::submit() {
  const std::span<const cpu::PlannedJob> planned = must(runner_.jobs(verticesPerJob));
  std::vector<cpu::PlannedJob> jobs(planned.begin(), planned.end());
  std::ranges::shuffle(jobs, random_);
  jobCount_ = jobs.size();
  const auto half = jobs.begin() + static_cast<std::ptrdiff_t>(jobs.size() / 2);
  const auto run = [](auto begin, auto end) {
    std::for_each(begin, end, [](const cpu::PlannedJob& job) { cpu::run(job); });
  };
  std::thread other(run, jobs.begin(), half);
  run(half, jobs.end());
  other.join();
}

void CpuEngine::abandon(const std::function<void()>& meanwhile) {
  static_cast<void>(must(runner_.jobs(verticesPerJob)));
  meanwhile();
  must(scene().abandonFrame(frame()));
}

std::vector<std::byte> CpuEngine::readOutput() const {
  const std::span<const std::byte> bytes = runner_.output();
  return {bytes.begin(), bytes.end()};
}

Streams CpuEngine::read(std::span<const std::byte> bytes, InstanceHandle instance) const {
  const InstanceOutput output = must(scene().output(instance));
  const std::uint32_t vertices = vertexCounts_.at({output.mesh.index, output.mesh.generation});
  return readStreams(bytes, output, vertices);
}

}  // namespace dermis::test
