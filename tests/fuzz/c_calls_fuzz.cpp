// libFuzzer: a sequence of calls of the C interface, without a Vulkan device (c_calls.h makes their
// arguments). A call that fails must leave its outputs as they are and say why; a handle of nothing
// must never be accepted; calls that break no rule must succeed; and what was written is read.

#include <bit>
#include <cmath>
#include <cstddef>
#include <map>
#include <vector>

#include "c_calls_import.h"

namespace dermis::fuzz {
namespace {

/// A handle of any kind.
struct Handle {
  std::uint32_t kind = 0, index = 0, generation = 0;
  friend bool operator==(const Handle&, const Handle&) = default;
};
template <typename T>
Handle handleOf(const T& handle) {
  return std::bit_cast<Handle>(handle);
}
struct LiveMesh {
  Handle handle;
  dermis_packed_info info;
};
struct LivePose {
  Handle handle;
  std::uint32_t joints = 0;
  bool isGpu = false;
};
struct LiveInstance {
  Handle handle, mesh, pose;
};
template <typename Live, typename T>
Live* find(std::vector<Live>& live, const T& handle) {
  for (Live& one : live) {
    if (one.handle == handleOf(handle)) return &one;
  }
  return nullptr;
}
struct Buffer {
  Bytes bytes;
  std::size_t size = 0;
  dermis_buffer_role role{};
};

/// A scene with who executes it, and what must be true of it.
struct Engine {
  Bytes output;
  std::map<std::uint32_t, Buffer> buffers;
  std::uint32_t failures = 0;  ///< so many of the next buffers cannot be created
  dermis_code failure{};
  std::set<int>* codes = nullptr;
  std::uint32_t mapped = 0;  ///< buffers: none, those that should be, all
  Owned<dermis_runner> runner;
  Owned<dermis_commands> commands;
  dermis_scene* scene = nullptr;
  std::vector<LiveMesh> meshes;
  std::vector<LivePose> poses;
  std::vector<LiveInstance> instances;
  std::uint64_t frame = 0, completed = 0, outputOffset = 0;
  bool isExecuted = false;  ///< the frame that was begun last
  bool isCapped = false;    ///< there may be no room for more
  bool isFinite = true;     ///< what was written for poses

  bool hasRoom() const { return !isCapped && failures == 0; }
};

dermis_code createBuffer(void* user, const dermis_scene_buffer* wanted, void** mapped,
                         dermis_error* error) {
  Engine& engine = *static_cast<Engine*>(user);
  const std::size_t size = wanted->requirement.byte_count;
  expect(wanted->size == sizeof(*wanted) && wanted->number != DERMIS_VISIBILITY_BUFFER);
  expect(wanted->role < DERMIS_BUFFER_ROLE_COUNT && size > 0);
  expect(!engine.buffers.contains(wanted->number));
  if (engine.failures > 0) {
    --engine.failures;
    const bool isOfDermis =
        engine.failure >= DERMIS_INVALID_ARGUMENT && engine.failure <= DERMIS_IO_ERROR;
    engine.codes->insert(isOfDermis ? engine.failure : DERMIS_VULKAN_ERROR);
    // A message, sometimes, without a zero at its end.
    if (engine.mapped != 0) std::memset(error->message, 'x', sizeof(error->message));
    return engine.failure;
  }
  Buffer& buffer = engine.buffers[wanted->number];
  buffer = {Bytes(new std::byte[size]), size, wanted->role};
  if (engine.mapped == 2 || (engine.mapped == 1 && wanted->is_mapped)) *mapped = buffer.bytes.get();
  return DERMIS_OK;
}
void releaseBuffer(void* user, std::uint32_t number) {
  expect(static_cast<Engine*>(user)->buffers.erase(number) == 1);
}

class Caller : Imports {
 public:
  Caller(const std::uint8_t* bytes, std::size_t size) : Imports(bytes, size) {}

  void run() {
    using Step = void (Caller::*)();
    constexpr std::array<Step, 32> steps{
        &Caller::pack,        &Caller::pack,        &Caller::repair,        &Caller::load,
        &Caller::centers,     &Caller::place,       &Caller::makeRunner,    &Caller::makeCommands,
        &Caller::addMesh,     &Caller::addMesh,     &Caller::addPoses,      &Caller::addPoses,
        &Caller::addInstance, &Caller::addInstance, &Caller::addInstance,   &Caller::remove,
        &Caller::remove,      &Caller::beginFrame,  &Caller::beginFrame,    &Caller::writePose,
        &Caller::markWritten, &Caller::change,      &Caller::change,        &Caller::execute,
        &Caller::execute,     &Caller::execute,     &Caller::ask,           &Caller::makePlan,
        &Caller::compare,     &Caller::model,       &Caller::listPipelines, &Caller::abandon};
    for (int step = 0; step < 300 && data_.remaining_bytes() > 0; ++step) {
      isNull_ = false;
      (this->*anyOf(steps))();
    }
    for (const auto& engine : engines_) dermis_destroy(engine->scene);  // it is lent: no effect
  }
  static std::uint64_t count() { return calls; }

 private:
  // ---- Scenes.

  dermis_scene_desc makeScene(Engine& engine) {
    dermis_scene_desc scene{};
    scene.frames_in_flight = number(0, 3);
    if (oneOf(2)) return scene;
    engine.isCapped = true;
    for (dermis_capacity* capacity : {&scene.mesh_bytes, &scene.joints, &scene.gpu_joints,
                                      &scene.output_bytes, &scene.instances, &scene.bounds}) {
      if (oneOf(4)) capacity->initial = number(0, 2000);
      if (oneOf(4)) capacity->maximum = number(0, 20000);
    }
    return scene;
  }
  void keep(std::unique_ptr<Engine> engine) {
    if (engines_.size() >= 3) engines_.erase(engines_.begin());
    engines_.push_back(std::move(engine));
  }
  Engine& anyEngine() {
    while (engines_.empty()) oneOf(2) ? makeRunner() : makeCommands();
    return *anyOf(engines_);
  }
  void makeRunner() {
    auto engine = std::make_unique<Engine>();
    const auto scene = given(makeScene(*engine));
    dermis_runner_desc desc{};
    desc.scene = scene.get();
    if (oneOf(4)) {
      engine->isCapped = true;
      desc.output_byte_count = number(0, 30000);
      engine->output.reset(new std::byte[desc.output_byte_count]());
      desc.output = engine->output.get();
    }
    const auto runner = given(desc);
    const Made<dermis_runner> made;
    const auto code = call({&made}, dermis_runner_create, runner.get(), made.get());
    if (!scene.isValid || !runner.isValid) expect(code == DERMIS_INVALID_ARGUMENT);
    if (scene.isValid && runner.isValid && !engine->isCapped) expect(code == DERMIS_OK);
    if (code != DERMIS_OK) return;
    engine->runner = made.take();
    engine->scene = dermis_runner_scene(engine->runner.get());
    keep(std::move(engine));
  }
  void makeCommands() {
    auto engine = std::make_unique<Engine>();
    engine->codes = &codes_;
    isNull_ = false;
    engine->mapped = number(0, 2);
    engine->isCapped = oneOf(2);
    const auto scene = given(makeScene(*engine));
    const auto limits = given(makeLimits());
    const auto tuning = given(makeTuning());
    dermis_commands_desc desc{};
    desc.scene = scene.get();
    desc.limits = engine->isCapped ? limits.get() : nullptr;
    desc.tuning = tuning.get();
    desc.output_offset = engine->outputOffset = seldom() ? number(0, 100) * 48 : 0;
    desc.user = engine.get();
    desc.create_buffer = orNull(&createBuffer);
    desc.release_buffer = orNull(&releaseBuffer);
    failSoon(*engine);
    const auto commands = given(desc);
    const Made<dermis_commands> made;
    const auto code = call({&made}, dermis_commands_create, commands.get(), made.get());
    if (isNull_ || !commands.isValid) expect(code == DERMIS_INVALID_ARGUMENT);
    if (code != DERMIS_OK) return;
    engine->commands = made.take();
    engine->scene = dermis_commands_scene(engine->commands.get());
    keep(std::move(engine));
  }
  void failSoon(Engine& engine) {
    constexpr std::array failures{DERMIS_OUT_OF_MEMORY, DERMIS_VULKAN_ERROR, DERMIS_LIMIT_EXCEEDED,
                                  static_cast<dermis_code>(79)};
    if (engine.runner != nullptr || !seldom()) return;
    engine.failures = number(1, 3);
    engine.failure = anyOf(failures);
  }

  /// Mostly one that lives; otherwise any that a scene ever had, or of nothing.
  template <typename T, typename Live>
  T pick(const std::vector<Live>& live) {
    Handle handle{number(0, 4), number(0, 3), number(0, 3)};
    if (!seen_.empty() && !seldom()) handle = anyOf(seen_);
    if (!live.empty() && !seldom()) handle = anyOf(live).handle;
    return std::bit_cast<T>(handle);
  }
  template <typename Live>
  void added(std::vector<Live>& live, const Live& one, std::uint32_t kind) {
    expect(one.handle.kind == kind && one.handle.generation != 0);
    expect(find(live, one.handle) == nullptr);
    live.push_back(one);
    seen_.push_back(one.handle);
  }
  void addMesh() {
    Engine& engine = anyEngine();
    const Packed& one = anyPacked();
    failSoon(engine);
    const bool hasRoom = engine.hasRoom();
    const Outputs<dermis_mesh> mesh;
    const auto code =
        call({&mesh}, dermis_add_mesh, engine.scene, orNull(one.packed.get()), orNull(mesh.get()));
    if (hasRoom && !isNull_) expect(code == DERMIS_OK);
    if (code == DERMIS_OK) added(engine.meshes, LiveMesh{handleOf(mesh[0]), one.info}, 1);
  }
  void addPoses() {
    Engine& engine = anyEngine();
    dermis_pose_desc desc{};
    desc.joint_count = seldom() ? number(0, 65537) : number(1, 60);
    desc.written_by_gpu = oneOf(4);
    desc.promise = enumerator<dermis_promise>(2);
    const auto pose = given(desc);
    const bool isValid = pose.isValid && desc.joint_count >= 1 && desc.joint_count <= 65536 &&
                         desc.promise <= 2 && (desc.written_by_gpu == 0 || engine.commands);
    const std::uint32_t count = number(0, 4);
    failSoon(engine);
    const bool hasRoom = engine.hasRoom();
    const Outputs<dermis_pose> poses(count);
    const auto code =
        call({&poses}, dermis_add_poses, engine.scene, pose.get(), count, orNull(poses.get()));
    if (hasRoom && isValid && !isNull_) expect(code == DERMIS_OK);
    if (!isValid && count > 0) expect(code == DERMIS_INVALID_ARGUMENT);
    for (std::uint32_t i = 0; code == DERMIS_OK && i < count; ++i) {
      const bool isGpu = desc.written_by_gpu != 0;
      added(engine.poses, LivePose{handleOf(poses[i]), desc.joint_count, isGpu}, 2);
    }
  }
  dermis_instance_desc makeInstance(Engine& engine) {
    dermis_instance_desc desc{};
    desc.method = enumerator<dermis_method>(oneOf(2) ? 9 : 2);
    desc.mesh = pick<dermis_mesh>(engine.meshes);
    desc.pose = pick<dermis_pose>(engine.poses);
    desc.layout = makeLayout();
    desc.box = {{-4, -4, -4}, {4, 4, seldom() ? -4.0f : 4.0f}};
    desc.wants_bounds = oneOf(4);
    desc.update_interval = number(0, 3);
    desc.culled_on_gpu = engine.commands != nullptr && oneOf(4);
    desc.interpolates = desc.layout.has_motion != 0 && oneOf(2);
    return desc;
  }
  void addInstance() {
    Engine& engine = anyEngine();
    if (engine.meshes.empty()) addMesh();
    if (engine.poses.empty()) addPoses();
    const dermis_instance_desc desc = makeInstance(engine);
    const auto instance = given(desc);
    const LiveMesh* mesh = find(engine.meshes, desc.mesh);
    const LivePose* pose = find(engine.poses, desc.pose);
    failSoon(engine);
    isNull_ = false;
    const bool mustFit =
        mesh != nullptr && pose != nullptr && engine.hasRoom() && instance.isValid &&
        pose->joints >= mesh->info.required_joints && isPlain(desc.layout) &&
        (desc.layout.normals == 0 || mesh->info.has_normals != 0) &&
        (desc.layout.tangents == 0 || mesh->info.has_tangents != 0) &&
        desc.method <= DERMIS_METHOD_DUAL_QUATERNION && (engine.runner || desc.wants_bounds == 0);
    const Outputs<dermis_instance> made;
    const auto code =
        call({&made}, dermis_add_instance, engine.scene, instance.get(), orNull(made.get()));
    if (mustFit && !isNull_) expect(code == DERMIS_OK);
    if (code != DERMIS_OK) return;
    expect(instance.isValid && mesh != nullptr && pose != nullptr);
    added(engine.instances, LiveInstance{handleOf(made[0]), mesh->handle, pose->handle}, 3);
  }
  /// What lives and is not used can be removed, and nothing else.
  template <typename T, typename Live>
  void removeFrom(Engine& engine, std::vector<Live>& live,
                  dermis_code (*function)(dermis_scene*, T, dermis_error*)) {
    const T handle = pick<T>(live);
    const Handle removed = handleOf(handle);
    bool isGood = find(live, handle) != nullptr;
    for (const LiveInstance& one : engine.instances) {
      if (one.mesh == removed || one.pose == removed) isGood = false;
    }
    const auto code = call({}, function, engine.scene, handle);
    expect(code == (isGood ? DERMIS_OK : DERMIS_INVALID_ARGUMENT));
    if (isGood) std::erase_if(live, [&](const Live& one) { return one.handle == removed; });
  }
  void remove() {
    Engine& engine = anyEngine();
    if (oneOf(4)) return removeFrom(engine, engine.meshes, &dermis_remove_mesh);
    if (oneOf(2)) return removeFrom(engine, engine.poses, &dermis_remove_pose);
    removeFrom(engine, engine.instances, &dermis_remove_instance);
  }
  void change() {
    Engine& engine = anyEngine();
    std::vector<dermis_change> changes(number(0, 4));
    std::vector<dermis_morph_weight> morphs(number(0, 3));
    for (dermis_morph_weight& morph : morphs)
      morph = {number(0, 3), seldom() ? NAN : static_cast<float>(number(0, 4)) / 4};
    morphs.shrink_to_fit();
    bool mustSucceed = engine.hasRoom();
    for (dermis_change& one : changes) {
      const dermis_instance_desc desc = makeInstance(engine);
      one.what = seldom() ? any<std::uint32_t>() : 1u << number(0, 8);
      one.instance = pick<dermis_instance>(engine.instances);
      one.visible = number(0, 1);
      one.update_interval = desc.update_interval;
      one.method = desc.method;
      one.mesh = desc.mesh;
      one.pose = desc.pose;
      one.box = desc.box;
      one.morphs = orNull(morphs.data());
      one.morph_count = sizeOf(morphs);
      if (one.what != DERMIS_CHANGE_VISIBLE || !find(engine.instances, one.instance))
        mustSucceed = false;
    }
    const auto list = given(changes);
    failSoon(engine);
    wantsErrors_ = true;
    const auto code = call({}, dermis_change_instances, engine.scene, list.get(), sizeOf(changes));
    wantsErrors_ = false;
    if (mustSucceed && list.isValid) expect(code == DERMIS_OK);
    std::uint32_t applied = sizeOf(changes);
    if (code != DERMIS_OK && std::sscanf(lastMessage.c_str(), "change %u: ", &applied) != 1) {
      expect(!list.isValid);
      applied = 0;
    }
    for (std::uint32_t i = 0; i < applied; ++i) {
      LiveInstance* instance = find(engine.instances, changes.at(i).instance);
      expect(instance != nullptr && changes[i].what <= 255);
      if ((changes[i].what & DERMIS_CHANGE_MESH) != 0) {
        expect(find(engine.meshes, changes[i].mesh) != nullptr);
        instance->mesh = handleOf(changes[i].mesh);
      }
      if ((changes[i].what & DERMIS_CHANGE_POSE) != 0) {
        expect(find(engine.poses, changes[i].pose) != nullptr);
        instance->pose = handleOf(changes[i].pose);
      }
    }
  }

  // ---- Frames.

  void beginFrame() {
    Engine& engine = anyEngine();
    const std::uint64_t frame = seldom() ? number(0, 20) : engine.frame + 1;
    std::uint64_t completed = seldom() ? number(0, 20) : engine.frame;
    const auto code = call({}, dermis_begin_frame, engine.scene, frame, completed);
    if (engine.runner != nullptr) completed = frame - 1;  // it is ignored
    if (frame <= engine.frame || completed >= frame || completed < engine.completed)
      expect(code == DERMIS_INVALID_ARGUMENT);
    else if (completed >= engine.frame)
      expect(code == DERMIS_OK);
    if (code != DERMIS_OK) return;
    engine.frame = frame;
    engine.completed = completed;
    engine.isExecuted = false;
    for (std::uint32_t i = number(0, 3); i > 0; --i) writePoseOf(engine);
  }
  void writePose() { writePoseOf(anyEngine()); }
  void writePoseOf(Engine& engine) {
    std::vector<dermis_pose> poses(number(1, 3));
    for (dermis_pose& pose : poses) pose = pick<dermis_pose>(engine.poses);
    dermis_joint* joints[3] = {};
    std::uint32_t counts[3] = {};
    const auto code = call({}, dermis_write_poses, engine.scene, poses.data(), sizeOf(poses),
                           joints, oneOf(4) ? nullptr : counts);
    bool isGood = !engine.isExecuted;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const LivePose* pose = find(engine.poses, poses[i]);
      isGood = isGood && pose && !pose->isGpu;
      expect((joints[i] != nullptr) == isGood);
      expect(counts[i] == 0 || (isGood && counts[i] == pose->joints));
      if (!isGood) continue;
      const std::uint32_t written = seldom() ? number(0, pose->joints) : pose->joints;
      if (!fill(joints[i], written) || written < pose->joints) engine.isFinite = false;
    }
    expect((code == DERMIS_OK) == isGood);
  }
  void markWritten() {
    Engine& engine = anyEngine();
    bool isGood = !engine.isExecuted;
    std::vector<dermis_pose> poses(number(1, 3));
    for (dermis_pose& pose : poses) {
      pose = pick<dermis_pose>(engine.poses);
      const LivePose* live = find(engine.poses, pose);
      if (live == nullptr || !live->isGpu) isGood = false;
    }
    const auto code = call({}, dermis_mark_written, engine.scene, poses.data(), sizeOf(poses));
    expect((code == DERMIS_OK) == isGood);
  }
  void execute() {
    Engine& engine = anyEngine();
    if (engine.isExecuted && !seldom()) return oneOf(4) ? abandon() : beginFrame();
    engine.runner != nullptr ? runJobs(engine) : planCommands(engine);
  }
  void abandon() {
    Engine& engine = anyEngine();
    const std::uint64_t frame = seldom() ? number(0, 20) : engine.frame;
    const auto code = call({}, dermis_abandon_frame, engine.scene, frame);
    expect((code == DERMIS_OK) == (engine.isExecuted && frame == engine.frame));
    if (code == DERMIS_OK) engine.isExecuted = false;
    runJob(engine, 0, false);
  }
  void runJob(const Engine& engine, std::uint32_t index, bool mustRun) {
    if (engine.runner == nullptr) return;
    const auto code = call({}, dermis_run_job, engine.runner.get(), index);
    expect((code == DERMIS_OK) == mustRun);
  }
  void runJobs(Engine& engine) {
    const auto frame = filled<dermis_runner_frame>();
    isNull_ = false;
    const std::uint32_t vertices = oneOf(2) ? 0 : number(1, 50);
    const auto code =
        call({&frame}, dermis_runner_jobs, engine.runner.get(), vertices, orNull(frame.get()));
    if (engine.frame == 0 || isNull_ || !frame.isValid)
      return expect(code == DERMIS_INVALID_ARGUMENT);
    if (!engine.isExecuted) expect(code == DERMIS_OK);
    if (code != DERMIS_OK) return;
    engine.isExecuted = true;
    const std::uint32_t jobs = frame->job_count, run = seldom() ? number(0, jobs) : jobs;
    for (std::uint32_t i = 0; i < run; ++i) {
      runJob(engine, jobs - 1 - i, true);
      if (seldom()) runJob(engine, jobs - 1 - i, true);  // against the rule, but harmless
    }
    runJob(engine, jobs + number(0, 1), false);
    if (run < jobs) engine.isFinite = false;
    readOutput(engine, static_cast<const std::byte*>(frame->output), frame->output_byte_count);
  }
  /// Reads all that was written. Without memory, checks only where it is.
  void readOutput(Engine& engine, const std::byte* output, std::uint64_t byteCount) {
    for (const LiveInstance& one : engine.instances) {
      const Filled<dermis_instance_info> info;
      expect(call({&info}, dermis_instance_contents, engine.scene,
                  std::bit_cast<dermis_instance>(one.handle), info.get()) == DERMIS_OK);
      const LiveMesh* mesh = find(engine.meshes, info->mesh);
      if (info->is_written == 0 || mesh == nullptr) continue;  // or its mesh was replaced
      for (const dermis_place& place : info->places.streams) {
        const std::uint32_t size = sizeOf(place.format);
        for (std::uint32_t v = 0; size != 0 && v < mesh->info.vertex_count; ++v) {
          const std::uint64_t at =
              place.offset - engine.outputOffset + std::uint64_t{v} * place.stride;
          expect(at <= byteCount && size <= byteCount - at);
          float values[4] = {};
          if (output != nullptr) std::memcpy(values, output + at, size);
          if (place.format > DERMIS_FORMAT_FLOAT32X4 || !engine.isFinite) continue;
          for (const float value : values) expect(std::isfinite(value));
        }
      }
    }
  }
  /// Executes what the CPU can: uploads, copies and clears.
  void doCommand(Engine& engine, const dermis_command& command, std::uint64_t visibilityBytes) {
    const auto at = [&](std::uint32_t number, std::uint64_t offset, std::uint64_t size) {
      const Buffer& buffer = engine.buffers.at(number);
      expect(offset <= buffer.size && size <= buffer.size - offset);
      return buffer.bytes.get() + offset;
    };
    if (command.kind == DERMIS_DISPATCH) {
      checkDispatch(command.as.dispatch, [&](std::uint32_t number) -> std::uint64_t {
        if (number == DERMIS_VISIBILITY_BUFFER) return visibilityBytes;
        return engine.buffers.at(number).size;
      });
    } else if (command.kind == DERMIS_UPLOAD) {
      const auto& [to, bytes] = command.as.upload;
      std::memcpy(at(to.buffer, to.offset, to.byte_count), bytes, to.byte_count);
    } else if (command.kind == DERMIS_COPY) {
      const dermis_copy& copy = command.as.copy;
      std::memcpy(at(copy.to, copy.to_offset, copy.byte_count),
                  at(copy.from, copy.from_offset, copy.byte_count), copy.byte_count);
    } else if (command.kind == DERMIS_CLEAR) {
      const dermis_part& part = command.as.clear;
      std::memset(at(part.buffer, part.offset, part.byte_count), 0, part.byte_count);
    } else {
      expect(command.kind == DERMIS_BARRIER && command.as.barrier.before != 0);
    }
  }
  void planCommands(Engine& engine) {
    const Filled<dermis_scene_info> scene;
    expect(call({&scene}, dermis_scene_contents, engine.scene, scene.get()) == DERMIS_OK);
    failSoon(engine);
    const bool mustPlan = engine.frame > 0 && !engine.isExecuted && engine.hasRoom();
    const Outputs<const dermis_command*> list;
    const Outputs<std::uint32_t> count, output;
    std::vector<std::byte> tables(seldom() ? 64 : 1 << 16);
    const auto code =
        call({&list, &count}, dermis_commands_plan, engine.commands.get(), tables.data(),
             tables.size(), list.as<const dermis_command*>(), count.get());
    if (mustPlan) expect(code == DERMIS_OK);
    if (engine.frame == 0) expect(code == DERMIS_INVALID_ARGUMENT);
    for (std::uint32_t i = 0; code == DERMIS_OK && i < count[0]; ++i)
      doCommand(engine, list[0][i], std::uint64_t{scene->visibility_count} * 4);
    if (seldom()) return;
    const auto committed =
        call({&output}, dermis_commands_commit, engine.commands.get(), output.get());
    if (code == DERMIS_OK) expect(committed == DERMIS_OK);
    if (committed != DERMIS_OK) return;
    engine.isExecuted = true;
    expect(engine.buffers.at(output[0]).role == DERMIS_BUFFER_OUTPUT);
    readOutput(engine, nullptr, engine.buffers.at(output[0]).size);
  }

  void ask() {
    Engine& engine = anyEngine();
    const auto instance = pick<dermis_instance>(engine.instances);
    const auto info = filled<dermis_instance_info>();
    const auto known = call({&info}, dermis_instance_contents, engine.scene, instance, info.get());
    expect((known == DERMIS_OK) == (info.isValid && find(engine.instances, instance)));
    if (known == DERMIS_OK) expect(info->interpolation > 0 && info->interpolation <= 1);
    const auto scene = filled<dermis_scene_info>();
    const auto told = call({&scene}, dermis_scene_contents, engine.scene, scene.get());
    expect((told == DERMIS_OK) == scene.isValid);
    for (std::uint32_t i = 0; scene.isValid && i < scene->skinned_count; ++i)
      expect(scene->skinned[i].kind == 3);
    for (std::uint32_t i = 0; scene.isValid && i < scene->settled_count; ++i)
      expect(scene->settled[i].kind == 3);

    std::vector<dermis_instance> drawn(number(0, 4));
    for (dermis_instance& one : drawn) one = pick<dermis_instance>(engine.instances);
    const std::vector<dermis_index_range> ranges(number(0, 6), {3, 6});
    const Outputs<dermis_indexed_draw> draws(drawn.size());
    const auto code = call({&draws}, dermis_indexed_draws, engine.scene, drawn.data(),
                           sizeOf(drawn), ranges.data(), sizeOf(ranges), draws.get());
    for (const dermis_instance& one : drawn)
      expect(code != DERMIS_OK || find(engine.instances, one) != nullptr);
    const Outputs<std::uint64_t> moved;
    const std::uint64_t bytes = seldom() ? ~std::uint64_t{0} : number(0, 9999);
    expect(call({}, dermis_compact, engine.scene, bytes, orNull(moved.get())) == DERMIS_OK);
    runJob(engine, 0, false);
    if (engine.commands == nullptr) return;

    const auto pose = pick<dermis_pose>(engine.poses);
    const LivePose* live = find(engine.poses, pose);
    const Outputs<dermis_part> part;
    const auto placed =
        call({&part}, dermis_commands_pose_part, engine.commands.get(), pose, part.get());
    expect((placed == DERMIS_OK) == (live != nullptr && live->isGpu));
    for (const auto& [name, buffer] : engine.buffers) {
      if (buffer.role != DERMIS_BUFFER_READ_BACK) continue;
      const auto copy = damaged(buffer.bytes.get(), buffer.size);
      call({}, dermis_commands_read_back, engine.commands.get(),
           engine.completed - (seldom() ? 1 : 0), copy.data(), copy.size());
    }
  }

  void listPipelines() {
    Engine& engine = anyEngine();
    dermis_instance_desc desc = makeInstance(engine);
    if (oneOf(2)) desc.mesh = {};
    if (oneOf(2)) desc.pose = {};
    const auto instance = given(desc);
    const auto limits = given(makeLimits());
    const auto tuning = given(makeTuning());
    const std::uint32_t capacity = number(0, 30);
    const Outputs<std::uint64_t> ids(capacity);
    const Outputs<std::uint32_t> count;
    const auto code =
        call({&ids, &count}, dermis_list_pipelines, oneOf(2) ? nullptr : engine.scene,
             instance.get(), limits.get(), tuning.get(), ids.get(), capacity, count.get());
    const std::uint32_t listed = code == DERMIS_OK ? std::min(capacity, count[0]) : 0;
    for (std::uint32_t i = 0; i <= listed; ++i) {
      const bool isListed = i < listed && !seldom();
      const std::uint64_t id = (i < listed ? ids[i] : any<std::uint64_t>()) ^
                               (isListed ? 0 : std::uint64_t{1} << number(0, 63));
      const auto info = filled<dermis_pipeline_info>();
      const auto described = call({&info}, dermis_describe_pipeline, id, info.get());
      if (isListed) expect((described == DERMIS_OK) == info.isValid);
      if (described != DERMIS_OK) continue;
      expect(std::memchr(info->module, '\0', sizeof(info->module)) != nullptr);
      expect(info->constant_count <= std::size(info->constants) && info->spirv[0] == 0x07230203);
      expect(info->spirv[info->word_count - 1] != 0);
    }
  }

  std::vector<Handle> seen_;
  std::vector<std::unique_ptr<Engine>> engines_;
};

struct AtExit {
  ~AtExit() {
    std::fprintf(stderr, "%llu calls\n", static_cast<unsigned long long>(Caller::count()));
  }
} atExit;

}  // namespace
}  // namespace dermis::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  dermis::fuzz::Caller(bytes, size).run();
  return 0;
}
