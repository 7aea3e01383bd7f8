// Scenes on the CPU.

#include "convert.h"
#include "dermis/cpu.h"

struct dermis_runner : dermis::c::Object {
  explicit dermis_runner(dermis::cpu::SceneRunner made) : runner(std::move(made)) {
    scene.scene = &runner.scene();
  }

  dermis::cpu::SceneRunner runner;
  dermis_scene scene;
  std::span<const dermis::cpu::PlannedJob> jobs;
  std::uint64_t changes = 0;  ///< of the scene, when the jobs were listed
};

using namespace dermis;
using namespace dermis::c;

extern "C" {

dermis_code dermis_runner_create(const dermis_runner_desc* callers, dermis_runner** runner,
                                 dermis_error* error) {
  return guarded(error, [&] {
    const dermis_runner_desc desc = inOrDefault(callers, "desc");
    dermis_runner*& result = required(runner, "runner");
    result = new dermis_runner(must(cpu::SceneRunner::create(
        sceneOf(desc.scene),
        array(static_cast<std::byte*>(desc.output), desc.output_byte_count, "output"))));
  });
}

dermis_scene* dermis_runner_scene(dermis_runner* runner) {
  return runner == nullptr ? nullptr : &runner->scene;
}

dermis_code dermis_runner_jobs(dermis_runner* runner, uint32_t vertices_per_job,
                               dermis_runner_frame* frame, dermis_error* error) {
  return guarded(error, [&] {
    dermis_runner& lender = required(runner, "runner");
    checkOut(frame, "frame");
    lender.jobs = {};
    lender.jobs =
        must(vertices_per_job == 0 ? lender.runner.jobs() : lender.runner.jobs(vertices_per_job));
    lender.changes = lender.scene.changes;
    dermis_runner_frame result{};
    result.job_count = static_cast<std::uint32_t>(lender.jobs.size());
    result.output = lender.runner.output().data();
    result.output_byte_count = lender.runner.output().size();
    give(frame, result);
  });
}

dermis_code dermis_run_job(const dermis_runner* runner, uint32_t index, dermis_error* error) {
  return guarded(error, [&] {
    const dermis_runner& lender = required(runner, "runner");
    if (index >= lender.jobs.size()) fail("the frame has no job " + std::to_string(index));
    if (lender.changes != lender.scene.changes)
      fail("a function of the scene was called since the jobs were listed");
    cpu::run(lender.jobs[index]);
  });
}

}  // extern "C"
