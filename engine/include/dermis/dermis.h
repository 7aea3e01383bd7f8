// The C interface of Dermis: the library `dermis` has core, the CPU path, the Vulkan back end and,
// if it was built with it, glTF import; the library `dermis_compare` has the reference. C99. What a
// function, a method or a format means is described in more detail in the C++ header that has it:
// mesh.h, layout.h, clips.h, rig.h, plan.h, scene.h, cpu.h, gltf.h, verify.h, vulkan/context.h,
// vulkan/scene_recorder.h.
//
// Rules, once:
//
// - A function that can fail returns a `dermis_code`. If it is not `DERMIS_OK`, `error` has a
//   sentence about it, unless `error` is null; outputs are then unchanged, if the function does not
//   say otherwise.
// - A structure that begins with `size` may grow. The caller sets `size` to its sizeof, also in
//   structures that a function fills: dermis_instance_info info = {.size = sizeof info} in C99. All
//   elements of an array have the same `size`.
// - Zero is the default of every other member: a structure of zeros with its `size` is valid, but
//   for what is marked as required.
// - Nothing is kept of a pointer after the function returns, unless it says so. Lists that a
//   function returns belong to the object; the function says how long they are valid.
// - `dermis_destroy` destroys every object that a function creates. Using a destroyed object is
//   undefined. Using the handle of something that was removed is an error.
// - One thread at a time may use an object. A context, a packed mesh, a bank, a packed rig and a
//   model may be used by any number of threads. So may a plan, unless `dermis_make_plan` fills it.
// - Callbacks get their `user` pointer first, and must not throw or longjmp. If one that creates
//   something fails, the function that needs it fails with its code and error; a code that is not
//   from `DERMIS_INVALID_ARGUMENT` to `DERMIS_IO_ERROR` counts as `DERMIS_VULKAN_ERROR`.
// - If memory of the library runs out, a function fails with `DERMIS_OUT_OF_MEMORY`; the object
//   that was changed may then only be destroyed.
#ifndef DERMIS_DERMIS_H
#define DERMIS_DERMIS_H

// With DERMIS_CDEF, declarations alone: dermis.cdef.h, for cffi.
#ifndef DERMIS_CDEF
#include <stddef.h>
#include <stdint.h>
#ifdef DERMIS_VULKAN
#include <vulkan/vulkan_core.h>
#endif
#endif

// What the library exports. For the static library, define DERMIS_STATIC.
#if defined(DERMIS_STATIC) || defined(DERMIS_CDEF)
#define DERMIS_C_API
#elif defined(_WIN32) && defined(DERMIS_BUILDS_C)
#define DERMIS_C_API __declspec(dllexport)
#elif defined(_WIN32)
#define DERMIS_C_API __declspec(dllimport)
#else
#define DERMIS_C_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

// ---- Errors, the version, objects.

// What a function returns. The error sentence says what is wrong.
#ifdef __cplusplus  // callbacks may return any number, which C++ allows with this type only
typedef enum dermis_code : uint32_t {
#else
typedef enum dermis_code {
#endif
  DERMIS_OK = 0,
  DERMIS_INVALID_ARGUMENT = 1,     // the caller broke a rule of the function
  DERMIS_INVALID_MESH = 2,         // `dermis_pack` refuses the mesh; `dermis_repair` may help
  DERMIS_INVALID_DATA = 3,         // a blob or file is damaged, or breaks the rules of its format
  DERMIS_UNSUPPORTED_VERSION = 4,  // a blob is from another version of Dermis
  DERMIS_UNSUPPORTED_FEATURE = 5,  // a file needs a feature that Dermis does not implement
  DERMIS_LIMIT_EXCEEDED = 6,       // more than the device, or a type of the interface, can hold
  DERMIS_NOT_PREPARED = 7,         // `dermis_record` needs a pipeline that was not prepared
  DERMIS_MISSING_ENTRY_POINT = 8,  // the driver does not have a function, or it was not enabled
  DERMIS_MISSING_FEATURE = 9,      // the device, or this build of Dermis, lacks a feature
  DERMIS_VULKAN_ERROR = 10,        // a Vulkan function failed: `dermis_error::vulkan_result`
  DERMIS_SHADER_ERROR = 11,        // SPIR-V is not valid
  DERMIS_IO_ERROR = 12,            // a file cannot be opened or read
  DERMIS_OUT_OF_MEMORY = 13,       // memory of the CPU
  DERMIS_CODE_INT32 = 0x7fffffff   // not a value: the type has 32 bits
} dermis_code;

// Why a function failed. The caller owns it; functions write to it only if they fail.
typedef struct dermis_error {
  dermis_code code;
  int32_t vulkan_result;  // the VkResult if a Vulkan function failed, otherwise 0
  char message[504];      // UTF-8, one sentence without a full stop; cut if it is longer
} dermis_error;

// The version of this header: major · 10000 + minor · 100 + patch.
enum { DERMIS_HEADER_VERSION = 100 };
// The version of the library. Its interface fits this header if the major versions are equal and
// its minor version is not lower; while the major version is 0, if the minor versions are equal.
DERMIS_C_API uint32_t dermis_version(void);

// Destroys a dermis_context, dermis_recorder, dermis_runner, dermis_commands, dermis_packed,
// dermis_repaired, dermis_bank, dermis_packed_rig, dermis_model, dermis_plan or dermis_bindings.
// Null is ignored. A scene belongs to its recorder, runner or commands, and is not destroyed.
DERMIS_C_API void dermis_destroy(void* object);

// ---- Plain data.

// Handles of the objects in a scene. The handle of a removed object is never valid again. All zeros
// are no object. `kind` is set by Dermis, so that a handle of one kind is an error where another
// kind is expected, in any language.
typedef struct dermis_mesh {
  uint32_t kind, index, generation;
} dermis_mesh;
// A pose.
typedef struct dermis_pose {
  uint32_t kind, index, generation;
} dermis_pose;
// An instance.
typedef struct dermis_instance {
  uint32_t kind, index, generation;
} dermis_instance;
// Clips that a scene has.
typedef struct dermis_clips {
  uint32_t kind, index, generation;
} dermis_clips;
// What plays clips.
typedef struct dermis_figure {
  uint32_t kind, index, generation;
} dermis_figure;
// A rig that a scene has.
typedef struct dermis_rig {
  uint32_t kind, index, generation;
} dermis_rig;

// A joint matrix: joint global transform × inverse bind matrix. An affine transform as a row-major
// 3×4 matrix, m[row][column]; column 3 is the translation. Skinned vertices are in the space of the
// joint global transforms.
typedef struct dermis_joint {
  float m[3][4];
} dermis_joint;

// An axis-aligned box.
typedef struct dermis_box {
  float min[3], max[3];
} dermis_box;

// A morph target that is active on an instance, and its weight.
typedef struct dermis_morph_weight {
  uint32_t target;
  float weight;  // finite
} dermis_morph_weight;

// What a pose promises of its joints.
typedef enum dermis_promise {
  DERMIS_PROMISE_SCALING = 0,        // nothing: joints may scale, shear and mirror
  DERMIS_PROMISE_SCALE_IGNORED = 1,  // only the rotation and the translation of a joint count
  DERMIS_PROMISE_RIGID = 2,          // joints only rotate and translate
  DERMIS_PROMISE_INT32 = 0x7fffffff  // not a value
} dermis_promise;

// How the joints of a vertex are blended (docs/methods.md). glTF viewers blend linearly.
typedef enum dermis_method {
  DERMIS_METHOD_DEFAULT = 0,  // dual quaternions
  DERMIS_METHOD_LINEAR = 1,
  DERMIS_METHOD_DUAL_QUATERNION = 2,
  DERMIS_METHOD_DUAL_QUATERNION_ITERATIVE = 3,  // this and the next three: for comparison
  DERMIS_METHOD_LOG_MATRIX = 4,
  DERMIS_METHOD_SPHERICAL_BLEND = 5,
  DERMIS_METHOD_QUATERNION_TRANSLATION = 6,
  DERMIS_METHOD_BLENDED = 7,
  DERMIS_METHOD_CENTER_OF_ROTATION = 8,  // this and the next need centers of rotation
  DERMIS_METHOD_BULGE_CONTROLLED = 9,
  DERMIS_METHOD_INT32 = 0x7fffffff  // not a value
} dermis_method;

// ---- Meshes in the caller's memory.

// How one component of an attribute is stored.
typedef enum dermis_component {
  DERMIS_FLOAT32 = 0,
  DERMIS_FLOAT16 = 1,
  DERMIS_SNORM8 = 2,
  DERMIS_SNORM16 = 3,
  DERMIS_UNORM8 = 4,
  DERMIS_UNORM16 = 5,
  DERMIS_UINT8 = 6,
  DERMIS_UINT16 = 7,
  DERMIS_UINT32 = 8,
  DERMIS_COMPONENT_INT32 = 0x7fffffff  // not a value
} dermis_component;

// An attribute: one element for each vertex. Needs no alignment.
typedef struct dermis_attribute {
  const void* data;  // the first element; null if the mesh does not have the attribute
  uint32_t stride;   // bytes from one element to the next; 0 if they follow each other
  dermis_component type;
  uint32_t components;  // per element
} dermis_attribute;

// Joints and weights of every vertex. `components` is the number of influences, the same for both.
typedef struct dermis_influence_set {
  dermis_attribute joints;   // uint8, uint16, uint32, or float32 with whole numbers
  dermis_attribute weights;  // float32, unorm8 or unorm16
} dermis_influence_set;

// A morph target: displacements, which are added to the bind pose before skinning.
typedef struct dermis_morph_target {
  // The vertices that the elements belong to, strictly ascending; null: all vertices of the mesh.
  const uint32_t* vertices;
  uint32_t vertex_count;       // of `vertices`; ignored if that is null
  dermis_attribute positions;  // float32, float16 or snorm16, × `position_scale`
  dermis_attribute normals, tangents;
  float position_scale[3];  // 0 0 0 counts as 1 1 1
} dermis_morph_target;

// A mesh in bind pose. Weights need not sum to 1. If a joint occurs twice in a vertex, its weights
// are added.
typedef struct dermis_mesh_view {
  uint32_t size;
  uint32_t vertex_count;
  const char* name;  // for messages only
  // Required. float32, float16, snorm16 or unorm16, 3 components (a fourth is ignored); multiplied
  // by `position_scale`, then `position_offset` is added.
  dermis_attribute positions;
  float position_scale[3];  // 0 0 0 counts as 1 1 1
  float position_offset[3];
  dermis_attribute normals;                    // float32, float16, snorm8 or snorm16, 3 components
  dermis_attribute tangents;                   // the same with 4; the fourth is the handedness
  const dermis_influence_set* influence_sets;  // at least one
  const dermis_morph_target* morph_targets;
  uint32_t influence_set_count, morph_target_count;
  // For some methods, 1 component of float32, unorm8 or unorm16, from 0 to 1:
  dermis_attribute dual_quaternion_weights;  // for `BLENDED`; absent: 0.5
  dermis_attribute bulge_strengths;          // for `BULGE_CONTROLLED`; absent: 1
  dermis_attribute centers_of_rotation;      // 3 float32: `dermis_centers_of_rotation`
} dermis_mesh_view;

// ---- Import: checking, repairing, packing. Needs no device; any thread.

// Kinds of problems of a mesh. `dermis_pack` refuses those up to `JOINT_OUT_OF_RANGE`;
// `dermis_repair` fixes those from `NON_FINITE_POSITION` to `JOINT_OUT_OF_RANGE`.
typedef enum dermis_problem {
  DERMIS_PROBLEM_EMPTY_MESH = 0,
  DERMIS_PROBLEM_NO_INFLUENCE_SETS = 1,
  DERMIS_PROBLEM_COUNT_MISMATCH = 2,
  DERMIS_PROBLEM_STRIDE_TOO_SMALL = 3,
  DERMIS_PROBLEM_WRONG_FORMAT = 4,
  DERMIS_PROBLEM_MORPH_VERTICES = 5,
  DERMIS_PROBLEM_NON_FINITE_POSITION = 6,
  DERMIS_PROBLEM_NON_FINITE_NORMAL = 7,
  DERMIS_PROBLEM_NON_FINITE_TANGENT = 8,
  DERMIS_PROBLEM_NON_FINITE_MORPH = 9,
  DERMIS_PROBLEM_NON_FINITE_CENTER = 10,
  DERMIS_PROBLEM_METHOD_WEIGHT_OUT_OF_RANGE = 11,
  DERMIS_PROBLEM_NON_FINITE_WEIGHT = 12,
  DERMIS_PROBLEM_NEGATIVE_WEIGHT = 13,
  DERMIS_PROBLEM_JOINT_OUT_OF_RANGE = 14,
  DERMIS_PROBLEM_WEIGHTS_NOT_NORMALIZED = 15,
  DERMIS_PROBLEM_DUPLICATE_JOINT = 16,
  DERMIS_PROBLEM_VERTEX_WITHOUT_WEIGHT = 17,
  DERMIS_PROBLEM_UNUSED_JOINT_OUT_OF_RANGE = 18,
  DERMIS_PROBLEM_NORMAL_LENGTH = 19,
  DERMIS_PROBLEM_TANGENT_LENGTH = 20,
  DERMIS_PROBLEM_TANGENT_SIGN = 21,
  DERMIS_PROBLEM_INT32 = 0x7fffffff  // not a value
} dermis_problem;

// One kind of problem in one mesh. Strings are valid during the callback.
typedef struct dermis_finding {
  uint32_t size;
  dermis_problem problem;
  uint32_t is_refused;    // whether `dermis_pack` refuses the mesh because of it
  uint32_t first_vertex;  // 0 if the problem is one of a view or of the whole mesh
  uint64_t count;         // vertices, displacements or views that have it
  const char* message;    // about the first place
} dermis_finding;

// Gets each finding. If it returns anything but `DERMIS_OK`, the function that called it stops and
// returns that.
typedef dermis_code (*dermis_finding_callback)(void* user, const dermis_finding* finding);

// Finds all problems of a mesh. Fails with `DERMIS_INVALID_MESH`, after the last finding, if
// `dermis_pack` refuses it. `found` may be null.
DERMIS_C_API dermis_code dermis_validate(const dermis_mesh_view* mesh, uint32_t joint_count,
                                         dermis_finding_callback found, void* user,
                                         dermis_error* error);

// A repaired copy of a mesh.
typedef struct dermis_repaired dermis_repaired;
// Drops influences that `dermis_pack` refuses, sets values that are not finite to 0, and clamps the
// weights of methods. The remaining weights are normalized by `dermis_pack`. `view` gets the
// repaired mesh, which is valid until `repaired` is destroyed.
// Fails with `DERMIS_INVALID_MESH` if a view is not valid.
DERMIS_C_API dermis_code dermis_repair(const dermis_mesh_view* mesh, uint32_t joint_count,
                                       dermis_mesh_view* view, dermis_repaired** repaired,
                                       dermis_error* error);

// How far the joints of a mesh reach, for boxes around it: for culling, and for positions in
// snorm16. Any number of threads may use it.
typedef struct dermis_joint_bounds dermis_joint_bounds;
// Collects it for poses of `joint_count` joints, once. `morph_ranges`: the least and the largest
// weight of each of `range_count` targets, two numbers each; without ranges 0 to 1.
DERMIS_C_API dermis_code dermis_joint_bounds_create(const dermis_mesh_view* mesh,
                                                    uint32_t joint_count, const float* morph_ranges,
                                                    uint32_t range_count,
                                                    dermis_joint_bounds** bounds,
                                                    dermis_error* error);
// Computes a box that contains the mesh in a pose, in a few microseconds. It is infinite for
// methods without a proof, for joints that are not finite, and if the pose lacks a joint
// (docs/bounds.md).
DERMIS_C_API dermis_code dermis_skinned_box(const dermis_joint_bounds* bounds,
                                            const dermis_joint* joints, uint32_t joint_count,
                                            dermis_method method, dermis_promise promise,
                                            dermis_box* box, dermis_error* error);

// A packed mesh: the blob that a scene needs. It can be stored with the assets.
typedef struct dermis_packed dermis_packed;
// Packs a mesh for a skeleton of `joint_count` joints, 1 to 65536: all joint indices must be less.
DERMIS_C_API dermis_code dermis_pack(const dermis_mesh_view* mesh, uint32_t joint_count,
                                     dermis_packed** packed, dermis_error* error);
// Makes a packed mesh from stored bytes, which it copies and checks.
DERMIS_C_API dermis_code dermis_packed_load(const void* bytes, size_t byte_count,
                                            dermis_packed** packed, dermis_error* error);

// What is known about a packed mesh.
typedef struct dermis_packed_info {
  uint32_t size;
  uint32_t vertex_count;
  const void* bytes;                        // the blob, valid as long as the packed mesh
  uint64_t byte_count;                      // of the blob
  uint32_t required_joints;                 // minimum joints of a pose: the largest joint index + 1
  uint32_t max_influences, min_influences;  // of a vertex
  uint32_t morph_target_count;
  uint32_t has_normals, has_tangents, has_centers_of_rotation;
} dermis_packed_info;
// Says what is known about a packed mesh.
DERMIS_C_API dermis_code dermis_packed_contents(const dermis_packed* packed,
                                                dermis_packed_info* info, dermis_error* error);

// Runs job(context, i) for every i below `count`, on any threads, and returns when all are done.
// Returns `DERMIS_OK`; anything else stops the function that called it, which returns that.
typedef dermis_code (*dermis_parallel_callback)(void* user, uint32_t count,
                                                void (*job)(void* context, uint32_t index),
                                                void* context);

// Computes the centers of rotation of a mesh (Le and Hodgins 2016), 3 floats per vertex, once, at
// import. `triangles` are 3 vertex indices each. The time is proportional to the number of terms,
// pairs of vertex and triangle with two joints in common; fails with `DERMIS_LIMIT_EXCEEDED` before
// it begins if there are more than `max_terms`, unless that is 0. `parallel` may be null.
DERMIS_C_API dermis_code dermis_centers_of_rotation(const dermis_mesh_view* mesh,
                                                    uint32_t joint_count, const uint32_t* triangles,
                                                    size_t index_count, uint64_t max_terms,
                                                    dermis_parallel_callback parallel, void* user,
                                                    float* centers, size_t float_count,
                                                    dermis_error* error);

// ---- What is written.

// The format of one attribute of skinned vertices. Beside it, how Vulkan reads it. The fourth
// component of X4 is 1 for positions, 0 for normals, and the handedness for tangents.
//
// Octahedral, with x and y from -1 to 1: z = 1 - |x| - |y|; if z < 0, x and y become
// (1 - |y|) sign(x) and (1 - |x|) sign(y) of the old values; normalize. For tangents see layout.h.
// Positions in snorm16: center + half of the size of the box × the stored value.
typedef enum dermis_format {
  DERMIS_FORMAT_NONE = 0,            // the attribute is not written; for positions: FLOAT32X3
  DERMIS_FORMAT_FLOAT32X3 = 1,       // VK_FORMAT_R32G32B32_SFLOAT
  DERMIS_FORMAT_FLOAT32X4 = 2,       // VK_FORMAT_R32G32B32A32_SFLOAT
  DERMIS_FORMAT_FLOAT16X3 = 3,       // from a storage buffer
  DERMIS_FORMAT_FLOAT16X4 = 4,       // VK_FORMAT_R16G16B16A16_SFLOAT
  DERMIS_FORMAT_SNORM16X3 = 5,       // from a storage buffer
  DERMIS_FORMAT_SNORM16X4 = 6,       // VK_FORMAT_R16G16B16A16_SNORM; positions: relative to a box
  DERMIS_FORMAT_SNORM8X3 = 7,        // no scene writes it
  DERMIS_FORMAT_SNORM8X4 = 8,        // VK_FORMAT_R8G8B8A8_SNORM
  DERMIS_FORMAT_OCTAHEDRAL16X2 = 9,  // VK_FORMAT_R16G16_SNORM, decoded by the shader
  DERMIS_FORMAT_OCTAHEDRAL8X2 = 10,  // VK_FORMAT_R8G8_SNORM, decoded by the shader
  DERMIS_FORMAT_INT32 = 0x7fffffff   // not a value
} dermis_format;

// The attributes of skinned vertices, as an index.
typedef enum dermis_stream {
  DERMIS_POSITIONS = 0,
  DERMIS_NORMALS = 1,
  DERMIS_TANGENTS = 2,
  DERMIS_PREVIOUS_POSITIONS = 3,  // for motion vectors
  DERMIS_STREAM_COUNT = 4
} dermis_stream;

// The attributes of skinned vertices and their arrangement: interleaved (position, normal, tangent,
// previous position of a vertex, then the next vertex) or, if `is_planar`, one attribute after the
// other, with gaps: `dermis_places` says where. Positions are in FLOAT32, FLOAT16 or SNORM16
// formats, normals in any, tangents in X4 or octahedral ones; the mesh must have what is written.
// Previous positions are those of the frame before, in the format of the positions; in the first
// frame, after a teleport and once a pose rests they are the current ones.
typedef struct dermis_layout {
  dermis_format positions, normals, tangents;
  uint32_t has_motion;  // whether there are previous positions
  uint32_t is_planar;
  uint32_t stride;  // of interleaved vertices, bytes; 0: the minimum
} dermis_layout;

// Where one attribute is: vertex v is at `offset` + v · `stride`, in bytes.
typedef struct dermis_place {
  uint64_t offset;
  uint32_t stride;
  dermis_format format;
} dermis_place;

// Where all attributes of an instance are.
typedef struct dermis_places {
  dermis_place streams[4];  // by `dermis_stream`
  uint64_t byte_count;      // of all vertices
  uint64_t alignment;       // the offset of the vertices is a multiple of this
} dermis_places;

// Places `vertex_count` vertices at byte `offset` of a buffer, which must be a multiple of
// `alignment`.
DERMIS_C_API dermis_code dermis_place_vertices(const dermis_layout* layout, uint32_t vertex_count,
                                               uint64_t offset, dermis_places* places,
                                               dermis_error* error);

// ---- A scene: meshes, poses and instances, and where their vertices are. Who executes its frames
// lends it: `dermis_recorder_scene`, `dermis_runner_scene`, `dermis_commands_scene`. In each frame:
//
//     dermis_begin_frame(scene, frame, completed_frame, &error);
//     dermis_write_poses(scene, poses, count, joints, NULL, &error);   and fill what they point to
//     ... add, remove, change ...
//     dermis_record, or dermis_runner_jobs, or dermis_commands_plan and _commit
//     draw from the output buffer, at dermis_instance_contents
//
// To execute a frame means `dermis_record`, `dermis_runner_jobs`, or `dermis_commands_plan` and
// `_commit`. Only poses that change are written; the others keep their joints. Functions that get a
// scene count as functions of the object that lends it.

typedef struct dermis_scene dermis_scene;

// How much a buffer holds.
typedef struct dermis_capacity {
  uint64_t initial;  // 0: the default
  uint64_t maximum;  // adding more fails with `DERMIS_LIMIT_EXCEEDED`; 0: no maximum
} dermis_capacity;

// How many frames may be in flight, and how much a scene holds.
typedef struct dermis_scene_desc {
  uint32_t size;
  // Frames whose fence the engine has not yet waited for when it begins a frame, the new one
  // included. 0: 2. Ignored on the CPU.
  uint32_t frames_in_flight;
  dermis_capacity mesh_bytes, joints, gpu_joints, output_bytes, instances, bounds;
} dermis_scene_desc;

// Adds a mesh. The packed mesh may then be destroyed.
DERMIS_C_API dermis_code dermis_add_mesh(dermis_scene* scene, const dermis_packed* packed,
                                         dermis_mesh* mesh, dermis_error* error);
// Fails if an instance uses the mesh.
DERMIS_C_API dermis_code dermis_remove_mesh(dermis_scene* scene, dermis_mesh mesh,
                                            dermis_error* error);

// What is fixed when a pose is added.
typedef struct dermis_pose_desc {
  uint32_t size;
  uint32_t joint_count;     // required: 1 to 65536; with a rig, that of its written joints
  uint32_t written_by_gpu;  // 0: the CPU writes it, where `dermis_write_poses` says
  dermis_promise promise;   // includes joints that a rig drives
  dermis_rig rig;           // computes the joints after the written ones; all zeros: none
} dermis_pose_desc;
// Adds `count` poses of the same description, all of identities until they are written. If it
// fails, it adds none.
DERMIS_C_API dermis_code dermis_add_poses(dermis_scene* scene, const dermis_pose_desc* desc,
                                          uint32_t count, dermis_pose* poses, dermis_error* error);
// Fails if an instance uses the pose.
DERMIS_C_API dermis_code dermis_remove_pose(dermis_scene* scene, dermis_pose pose,
                                            dermis_error* error);

// Who writes the morph weights of an instance.
typedef enum dermis_morph_writer {
  DERMIS_MORPH_WRITER_CPU = 0,  // `dermis_change_instances`
  // A GPU pass of the engine, to the same memory (`dermis_weights_range`); the engine then calls
  // `dermis_mark_morphs_written`.
  DERMIS_MORPH_WRITER_GPU = 1,
  // The clips that the figure of its pose plays; while its pose belongs to none, no target is
  // active.
  DERMIS_MORPH_WRITER_CLIPS = 2,
  DERMIS_MORPH_WRITER_INT32 = 0x7fffffff  // not a value
} dermis_morph_writer;

// An instance.
typedef struct dermis_instance_desc {
  uint32_t size;
  dermis_method method;
  dermis_mesh mesh;  // required
  dermis_pose pose;  // required
  dermis_layout layout;
  dermis_box box;            // for positions in snorm16
  uint32_t wants_bounds;     // whether to compute the exact box of the skinned positions
  uint32_t update_interval;  // skinned every N-th frame; 0: 1
  uint32_t culled_on_gpu;    // whether a word of the visibility buffer decides, too
  // Whether the engine draws it between its last two updates, so that it moves smoothly at a larger
  // interval N, N - 1 frames late. Requires motion in the layout.
  uint32_t interpolates;
  dermis_morph_writer morph_writer;  // other than the CPU needs a mesh with morph targets
  // With `DERMIS_MORPH_WRITER_CLIPS`: the node of the skeleton whose weights drive the instance,
  // with as many as the mesh has targets that no rig drives.
  uint32_t weights_of;
  // The number of the mesh's last morph targets whose weights are those of the rig of the pose,
  // consecutive from `first_driven_weight` on. Without a rig they are not active.
  uint32_t driven_targets;
  uint32_t first_driven_weight;
} dermis_instance_desc;
// Adds an instance. The next frame that is executed skins it.
DERMIS_C_API dermis_code dermis_add_instance(dermis_scene* scene, const dermis_instance_desc* desc,
                                             dermis_instance* instance, dermis_error* error);
// Removes an instance and its output.
DERMIS_C_API dermis_code dermis_remove_instance(dermis_scene* scene, dermis_instance instance,
                                                dermis_error* error);

// Begins frame number `frame`, counted from 1; numbers may be skipped. `completed_frame` is the
// newest frame that the GPU has completed, or 0; on the CPU, the frame before is complete.
DERMIS_C_API dermis_code dermis_begin_frame(dermis_scene* scene, uint64_t frame,
                                            uint64_t completed_frame, dermis_error* error);
// Gets memory for the joint matrices of poses in this frame. The engine writes all of it before the
// frame is executed, on any thread, and never reads it. `joint_counts` may be null. From the pose
// that fails on, pointers and counts are 0.
DERMIS_C_API dermis_code dermis_write_poses(dermis_scene* scene, const dermis_pose* poses,
                                            uint32_t count, dermis_joint** joints,
                                            uint32_t* joint_counts, dermis_error* error);
// States that a GPU pass of the engine writes these poses before the commands of this frame. If
// one fails, those before it are marked.
DERMIS_C_API dermis_code dermis_mark_written(dermis_scene* scene, const dermis_pose* poses,
                                             uint32_t count, dermis_error* error);
// The same for morph weights that a GPU pass of the engine writes.
DERMIS_C_API dermis_code dermis_mark_morphs_written(dermis_scene* scene,
                                                    const dermis_instance* instances,
                                                    uint32_t count, dermis_error* error);

// Which members of a `dermis_change` count. Combine them by |.
typedef enum dermis_change_bits {
  DERMIS_CHANGE_VISIBLE = 1,
  DERMIS_CHANGE_UPDATE_INTERVAL = 2,
  DERMIS_CHANGE_MESH = 4,
  DERMIS_CHANGE_POSE = 8,
  DERMIS_CHANGE_METHOD = 16,  // `dermis_prepare` must have been called for it
  DERMIS_CHANGE_BOX = 32,
  DERMIS_CHANGE_MORPHS = 64,
  DERMIS_CHANGE_TELEPORT = 128  // previous positions are set to the current ones
} dermis_change_bits;
// What changes about an instance.
typedef struct dermis_change {
  uint32_t size;
  uint32_t what;  // of `dermis_change_bits`
  dermis_instance instance;
  uint32_t visible;
  uint32_t update_interval;  // 0: 1
  dermis_method method;
  dermis_mesh mesh;
  dermis_pose pose;
  dermis_box box;
  const dermis_morph_weight* morphs;  // the active targets; they are copied
  uint32_t morph_count;
} dermis_change;
// Applies changes, one after the other. If one fails, those before it remain, those after it are
// not applied, and the message begins with "change " and its index. With a wrong `size`, none is.
DERMIS_C_API dermis_code dermis_change_instances(dermis_scene* scene, const dermis_change* changes,
                                                 uint32_t count, dermis_error* error);

// Moves outputs from the end of the output buffer into free ranges, at most `max_bytes`; `moved`
// gets how many bytes, and may be null.
DERMIS_C_API dermis_code dermis_compact(dermis_scene* scene, uint64_t max_bytes, uint64_t* moved,
                                        dermis_error* error);
// States that the frame that was executed last will never reach the GPU, or that none of its jobs
// was or will be run. The scene is then as after `dermis_begin_frame`; everything is skinned again.
DERMIS_C_API dermis_code dermis_abandon_frame(dermis_scene* scene, uint64_t frame,
                                              dermis_error* error);

// An instance, as of the last frame that was executed.
typedef struct dermis_instance_info {
  uint32_t size;
  uint32_t is_written;        // whether vertices are there
  uint32_t is_due;            // whether this frame skins it if its pose is written
  uint32_t visibility_index;  // of its word in the visibility buffer
  dermis_mesh mesh;           // that it was last skinned with
  uint32_t has_bounds;        // whether `bounds` is known
  dermis_box bounds;          // exact, of the newest complete frame that skinned it
  uint64_t offset;            // of the instance, bytes from the beginning of the output buffer
  dermis_places places;       // offsets count from the beginning of the output buffer
  // If it interpolates, otherwise 1: draw mix(previous, current, interpolation), which has moved by
  // (current - previous) * motion_scale since the last frame.
  float interpolation, motion_scale;
} dermis_instance_info;
// Says where an instance is.
DERMIS_C_API dermis_code dermis_instance_contents(const dermis_scene* scene,
                                                  dermis_instance instance,
                                                  dermis_instance_info* info, dermis_error* error);

// Indices of a mesh in the index buffer of the engine.
typedef struct dermis_index_range {
  uint32_t first, count;
} dermis_index_range;
// VkDrawIndexedIndirectCommand.
typedef struct dermis_indexed_draw {
  uint32_t index_count;
  uint32_t instance_count;  // 1, or 0 if vertices are not there
  uint32_t first_index;
  int32_t vertex_offset;  // the first vertex of the instance in the output buffer
  uint32_t first_instance;
} dermis_indexed_draw;
// Fills `count` draws, one for each instance, for one indirect draw from the beginning of the
// output buffer. `ranges` are those of all meshes, by dermis_mesh::index. All layouts must be
// interleaved and have the same stride.
DERMIS_C_API dermis_code dermis_indexed_draws(const dermis_scene* scene,
                                              const dermis_instance* instances, uint32_t count,
                                              const dermis_index_range* ranges,
                                              uint32_t range_count, dermis_indexed_draw* draws,
                                              dermis_error* error);

// Bytes of one buffer of a scene.
typedef struct dermis_store {
  uint64_t capacity, used, largest_free;
} dermis_store;
// What the last frame did. Lists are valid until the next call of a function of the scene.
typedef struct dermis_scene_info {
  uint32_t size;
  uint32_t instances;              // in the scene
  uint64_t frame;                  // that was begun last
  const dermis_instance* skinned;  // instances that were skinned, without those culled on the GPU
  const dermis_instance* settled;  // of which only previous positions were written
  uint32_t skinned_count, settled_count;
  uint32_t converted_poses;
  uint32_t visibility_count;  // words of the visibility buffer
  uint64_t skinned_vertices, written_bytes, moved_bytes, pose_bytes;
  // What the visibility kernel counted in the newest complete frame.
  uint64_t completed_frame;
  uint32_t culled_candidates, gpu_visible, gpu_skinned, gpu_settled;
  dermis_store meshes, palettes, outputs;
  uint64_t sampled_figures;  // whose poses were sampled from clips
} dermis_scene_info;
// Says what the last frame did, and how much memory the scene has.
DERMIS_C_API dermis_code dermis_scene_contents(dermis_scene* scene, dermis_scene_info* info,
                                               dermis_error* error);

// ---- The CPU: runs the frames of a scene by SIMD instructions, without Vulkan.

// Owns a scene, and divides its frames into jobs.
typedef struct dermis_runner dermis_runner;
// What a runner needs to know.
typedef struct dermis_runner_desc {
  uint32_t size;
  const dermis_scene_desc* scene;  // null: the defaults
  // Optional: memory of the engine for the output, which must outlive the runner, and does not
  // grow.
  void* output;
  size_t output_byte_count;
} dermis_runner_desc;
// `desc` may be null.
DERMIS_C_API dermis_code dermis_runner_create(const dermis_runner_desc* desc,
                                              dermis_runner** runner, dermis_error* error);
// Valid until the runner is destroyed. Null if `runner` is null.
DERMIS_C_API dermis_scene* dermis_runner_scene(dermis_runner* runner);

// The jobs of a frame.
typedef struct dermis_runner_frame {
  uint32_t size;
  uint32_t job_count;
  const void* output;  // all vertices, once the jobs are done; valid until the next frame
  uint64_t output_byte_count;
} dermis_runner_frame;
// Lists the jobs for everything that changed. Call it once after each `dermis_begin_frame` and
// `dermis_abandon_frame`. Until the jobs are done, only `dermis_run_job` may be called of the
// functions of the runner and its scene; if none is run, `dermis_abandon_frame`.
// `vertices_per_job`: about how many; a job may have several instances. 0: 65536. For N threads, an
// N-th of all vertices, or a quarter of that, spreads the work.
DERMIS_C_API dermis_code dermis_runner_jobs(dermis_runner* runner, uint32_t vertices_per_job,
                                            dermis_runner_frame* frame, dermis_error* error);
// Runs job number `index` of the frame. The jobs of a frame may run on any threads, in any order
// and at the same time, each once: a second run would change previous positions.
DERMIS_C_API dermis_code dermis_run_job(const dermis_runner* runner, uint32_t index,
                                        dermis_error* error);

// ---- Commands, as plain data: those of a batch, which `dermis_record_plan` can record, and those
// of the frames of a scene, for an engine with its own RHI.

// Limits of a device: the VkPhysicalDeviceLimits of the same names, `max_storage_buffers_per_stage`
// is maxPerStageDescriptorStorageBuffers (plan.h). 0: what every Vulkan device has, which is too
// little for bounds and positions in snorm16. `dermis_context_create` fills them.
typedef struct dermis_limits {
  uint32_t size;
  uint32_t min_storage_buffer_offset_alignment;
  uint64_t max_storage_buffer_range;
  uint32_t max_workgroup_count_x, max_workgroup_count_y;
  uint32_t max_storage_buffers_per_stage;
  uint32_t one_output_range;       // whether a dispatch can bind only one window of the output
  uint32_t texel_buffers;          // whether kernels are those for CPU devices: needs shaderInt64
                                   // and scalarBlockLayout
  uint32_t staged_stores;          // whether kernels store interleaved vertices widely
  uint32_t no_comparison_methods;  // whether kernels of methods for comparison are missing
} dermis_limits;
// How work is divided; it affects speed only. 0: the default.
typedef struct dermis_tuning {
  uint32_t size;
  uint32_t workgroup_size;            // 64; a power of two from 8 to 128
  uint32_t instances_per_invocation;  // 4; 1 to 32
  uint32_t min_workgroups;
  uint32_t vertices_per_invocation;  // 1; a power of two up to 16
} dermis_tuning;

// A pose of a batch: consecutive `dermis_joint` in the poses buffer.
typedef struct dermis_batch_pose {
  uint64_t matrix_offset;  // bytes, a multiple of 16
  uint32_t joint_count;
  dermis_promise promise;
} dermis_batch_pose;
// An instance of a batch.
typedef struct dermis_job {
  uint32_t size;
  uint32_t pose;                   // index into `dermis_batch::poses`
  const dermis_packed_info* mesh;  // required: what `dermis_packed_contents` filled
  uint64_t mesh_offset;            // bytes into the mesh buffer, a multiple of 16
  dermis_places places;            // of `dermis_place_vertices`
  dermis_method method;
  dermis_box box;            // for positions in snorm16
  uint32_t wants_bounds;     // whether the box of the positions is written to the results buffer
  uint32_t restarts_motion;  // whether previous positions become the current ones
  uint32_t settles;          // whether only that is done
  uint32_t morph_count;
  const dermis_morph_weight* morphs;
} dermis_job;
// Everything that one `dermis_record_plan` skins.
typedef struct dermis_batch {
  uint32_t size;
  uint32_t pose_count, job_count;
  uint32_t has_separate_outputs;  // whether attributes have different output buffers
  const dermis_batch_pose* poses;
  const dermis_job* jobs;
  uint64_t mesh_bytes, pose_bytes;  // of these buffers
  uint64_t output_bytes[4];         // of the output buffer of each attribute
} dermis_batch;

// The buffers of a batch or a scene.
typedef enum dermis_buffer_role {
  DERMIS_BUFFER_MESHES = 0,
  DERMIS_BUFFER_POSES = 1,
  DERMIS_BUFFER_TABLES = 2,
  DERMIS_BUFFER_PALETTES = 3,
  DERMIS_BUFFER_RESULTS = 4,  // of a batch, for each job with results: 6 words of its box, see
                              // `InstanceResult` in plan.h, its clamped vertices, and 0
  DERMIS_BUFFER_OUTPUT = 5,   // positions; in a scene, and usually in a batch, all attributes
  DERMIS_BUFFER_NORMALS = 6,
  DERMIS_BUFFER_TANGENTS = 7,
  DERMIS_BUFFER_PREVIOUS_POSITIONS = 8,
  DERMIS_BUFFER_GPU_POSES = 9,  // this and the next three: only in a scene
  DERMIS_BUFFER_READ_BACK = 10,
  DERMIS_BUFFER_VISIBILITY = 11,
  DERMIS_BUFFER_HISTORY = 12,
  DERMIS_BUFFER_ROLE_COUNT = 13
} dermis_buffer_role;
// What a buffer needs.
typedef struct dermis_requirement {
  uint64_t byte_count;
  uint32_t alignment;  // of its offset, if it is a part of a larger buffer
  uint32_t usage;      // VkBufferUsageFlags; the engine adds its own
} dermis_requirement;

// The number of a buffer in commands: in a batch its `dermis_buffer_role`, in a scene
// dermis_scene_buffer::number, or 0 for the visibility buffer.
enum { DERMIS_VISIBILITY_BUFFER = 0 };
// A part of a buffer.
typedef struct dermis_part {
  uint64_t offset, byte_count;
  uint32_t buffer;  // its number
} dermis_part;
// A descriptor of descriptor set 0.
typedef struct dermis_binding {
  dermis_part part;
  uint32_t slot;
  uint32_t is_texel_buffer;  // uniform, VK_FORMAT_R32G32B32A32_UINT; otherwise a storage buffer
} dermis_binding;

// What a command does.
typedef enum dermis_command_kind {
  DERMIS_DISPATCH = 0,               // bind the pipeline, push the constants, dispatch
  DERMIS_UPLOAD = 1,                 // copy `bytes` to a part, for example by a staging buffer
  DERMIS_COPY = 2,                   // vkCmdCopyBuffer
  DERMIS_CLEAR = 3,                  // vkCmdFillBuffer with zeros
  DERMIS_BARRIER = 4,                // a memory barrier between two uses
  DERMIS_COMMAND_INT32 = 0x7fffffff  // not a value
} dermis_command_kind;
// A dispatch.
typedef struct dermis_dispatch {
  uint64_t pipeline;                      // `dermis_describe_pipeline`
  uint32_t group_count_x, group_count_y;  // 0 if indirect
  // Where the arguments of vkCmdDispatchIndirect are, if indirect; otherwise of 0 bytes.
  dermis_part indirect;
  const dermis_binding* bindings;
  uint32_t binding_count, constant_count;
  uint32_t constants[9];  // push constants from offset 0
} dermis_dispatch;
// Bytes of the CPU that are copied to a buffer; valid as long as the command.
typedef struct dermis_upload {
  dermis_part to;
  const void* bytes;
} dermis_upload;
// A copy from buffer to buffer.
typedef struct dermis_copy {
  uint32_t from, to;  // numbers of buffers
  uint64_t from_offset, to_offset, byte_count;
} dermis_copy;
// What comes before and after a barrier.
typedef struct dermis_barrier_uses {
  uint32_t before, after;  // of `dermis_use`
} dermis_barrier_uses;
// One command: the member of `as` that `kind` says.
typedef struct dermis_command {
  dermis_command_kind kind;
  union {
    dermis_dispatch dispatch;
    dermis_upload upload;
    dermis_copy copy;
    dermis_part clear;
    dermis_barrier_uses barrier;
  } as;
} dermis_command;

// The commands of a batch.
typedef struct dermis_plan dermis_plan;
// Turns a batch into commands. If *plan is null, a plan is created; otherwise it is filled again.
// If the function fails, an existing plan is empty. For `dermis_record_plan`, limits and tuning
// must be those of `dermis_context_create`, or the pipelines those of `dermis_list_pipelines` for
// them.
DERMIS_C_API dermis_code dermis_make_plan(const dermis_batch* batch, const dermis_limits* limits,
                                          const dermis_tuning* tuning, dermis_plan** plan,
                                          dermis_error* error);
// The contents of a plan, valid until it is filled again or destroyed.
typedef struct dermis_plan_info {
  uint32_t size;
  uint32_t command_count;
  const dermis_command* commands;
  const uint64_t* pipelines;  // of the dispatches, each once
  // Byte offset in the results buffer of the first job with results; the others follow in the order
  // of the jobs, 32 bytes each.
  uint64_t first_result;
  uint32_t pipeline_count;
  uint32_t dispatch_count;
  dermis_requirement buffers[9];  // by `dermis_buffer_role`
} dermis_plan_info;
// Lists what a plan has.
DERMIS_C_API dermis_code dermis_plan_contents(const dermis_plan* plan, dermis_plan_info* info,
                                              dermis_error* error);
// Writes the tables that the kernels read: as many bytes as the tables buffer needs.
DERMIS_C_API dermis_code dermis_write_tables(const dermis_plan* plan, void* bytes,
                                             size_t byte_count, dermis_error* error);

// Lists the pipelines that instances like this one can need, at most `capacity`, which may be 0;
// `count` gets how many there are. Limits and tuning are those of the commands. With a scene and
// valid handles, only for the same kind of mesh and pose; with null handles, for any; without a
// scene (`scene` may be null) for any, but poses of figures, and those with rigs unless
// `driven_targets` is not 0. With a null pose, figures and rigs count if the scene has some. For an
// engine with its own RHI; others call `dermis_prepare`.
DERMIS_C_API dermis_code dermis_list_pipelines(const dermis_scene* scene,
                                               const dermis_instance_desc* desc,
                                               const dermis_limits* limits,
                                               const dermis_tuning* tuning, uint64_t* pipelines,
                                               uint32_t capacity, uint32_t* count,
                                               dermis_error* error);
// What a compute pipeline is built from. The SPIR-V is static.
typedef struct dermis_pipeline_info {
  uint32_t size;
  uint32_t word_count;
  const uint32_t* spirv;   // SPIR-V 1.3, entry point "main"
  char module[64];         // its name
  uint32_t constants[32];  // specialization constants from id 0 on
  uint32_t constant_count;
  // In slots from 0 on, first the storage buffers. A dispatch binds only those that it uses: the
  // descriptors of the others need not be written. Push constants: at most 9 words.
  uint32_t storage_buffers, texel_buffers;
} dermis_pipeline_info;
// Describes a pipeline that a plan or `dermis_list_pipelines` named. Needs no device.
DERMIS_C_API dermis_code dermis_describe_pipeline(uint64_t pipeline, dermis_pipeline_info* info,
                                                  dermis_error* error);

// A buffer that a scene asks for.
typedef struct dermis_scene_buffer {
  uint32_t size;
  uint32_t number;  // by which commands name it
  dermis_buffer_role role;
  // Whether the scene writes (POSES) or reads (READ_BACK) it through a mapping, if it gets one, of
  // host-coherent memory. Poses that are mapped are not uploaded.
  uint32_t is_mapped;
  dermis_requirement requirement;
} dermis_scene_buffer;
// What commands need to know.
typedef struct dermis_commands_desc {
  uint32_t size;
  const dermis_scene_desc* scene;  // null: the defaults
  const dermis_limits* limits;     // null: those that every Vulkan device has
  const dermis_tuning* tuning;     // null: the default
  // Of the output, if it is a part of a larger buffer: dermis_instance_info counts from the
  // beginning of that buffer, commands from here.
  uint64_t output_offset;
  void* user;
  // Required. Creates a buffer, when the commands are created, when something is added or changed,
  // and in `dermis_commands_plan`; `mapped` gets the address of its first byte, or null. If it
  // fails, the scene may ask for a smaller one. Neither function may call the scene.
  dermis_code (*create_buffer)(void* user, const dermis_scene_buffer* buffer, void** mapped,
                               dermis_error* error);
  // Required. Releases a buffer that no frame in flight uses. Buffers that remain when the
  // commands are destroyed, or could not be created, are not released.
  void (*release_buffer)(void* user, uint32_t number);
} dermis_commands_desc;
// Owns a scene, and lists the commands of its frames.
typedef struct dermis_commands dermis_commands;
// Creates a scene and its first buffers.
DERMIS_C_API dermis_code dermis_commands_create(const dermis_commands_desc* desc,
                                                dermis_commands** commands, dermis_error* error);
// Valid until the commands are destroyed. Null if `commands` is null.
DERMIS_C_API dermis_scene* dermis_commands_scene(dermis_commands* commands);
// Lists the commands for everything that changed since the last `dermis_commands_commit`. The list
// has the barriers between its commands and to the frames before. The engine adds those between its
// own uses of the output and `DERMIS_USE_DERMIS`, before and after; and after it, for a read-back
// buffer that it copies further, that from COPY_WRITE to COPY_READ. They are
// valid until the next call of a function of the scene or of this object.
//
// `tables`, `table_bytes`: optional memory for the bytes of the first DERMIS_UPLOAD, for example a
// mapped staging buffer that no frame in flight uses. This saves copying them. They start at
// `tables`, unless there are too many: then `bytes` of the upload points elsewhere. This memory is
// read only if it turns out to be too small.
DERMIS_C_API dermis_code dermis_commands_plan(dermis_commands* commands, void* tables,
                                              size_t table_bytes, const dermis_command** list,
                                              uint32_t* count, dermis_error* error);
// States that the commands of the last plan have been recorded. `output_buffer` gets the number of
// the output buffer, and may be null.
DERMIS_C_API dermis_code dermis_commands_commit(dermis_commands* commands, uint32_t* output_buffer,
                                                dermis_error* error);
// For read-back buffers that are not mapped: reads the results of a complete frame, after the
// `dermis_begin_frame` that reported it, in ascending order. `bytes` are the whole READ_BACK buffer
// that a DERMIS_COPY of that frame wrote; `byte_count` is 0 if none did.
DERMIS_C_API dermis_code dermis_commands_read_back(dermis_commands* commands, uint64_t frame,
                                                   const void* bytes, size_t byte_count,
                                                   dermis_error* error);
// Where the joint matrices of a pose are that a GPU pass of the engine writes, or that belongs to a
// figure. Behind those that the engine writes are the given weights of its rig.
DERMIS_C_API dermis_code dermis_commands_pose_part(const dermis_commands* commands,
                                                   dermis_pose pose, dermis_part* part,
                                                   dermis_error* error);
// Where the morph weights of an instance are that a GPU pass of the engine writes: a float for each
// target of its mesh that no rig drives.
DERMIS_C_API dermis_code dermis_commands_weights_part(const dermis_commands* commands,
                                                      dermis_instance instance, dermis_part* part,
                                                      dermis_error* error);
// Where the joints are that the rig of a pose drives, and behind them all its weights, a float
// each.
DERMIS_C_API dermis_code dermis_commands_driven_part(const dermis_commands* commands,
                                                     dermis_pose pose, dermis_part* part,
                                                     dermis_error* error);

// How a buffer is used before or after Dermis. Combine uses by |.
typedef enum dermis_use {
  DERMIS_USE_DERMIS = 1,  // what compute shaders of Dermis read and write; no list has it
  DERMIS_USE_VERTEX_INPUT = 2,
  DERMIS_USE_VERTEX_SHADER = 4,
  DERMIS_USE_FRAGMENT_SHADER = 8,
  DERMIS_USE_TASK_SHADER = 16,
  DERMIS_USE_MESH_SHADER = 32,
  DERMIS_USE_RAY_TRACING = 64,
  DERMIS_USE_ACCELERATION_STRUCTURE_BUILD = 128,
  DERMIS_USE_COMPUTE_READ = 256,
  DERMIS_USE_COMPUTE_WRITE = 512,
  DERMIS_USE_COPY_READ = 1024,
  DERMIS_USE_COPY_WRITE = 2048,
  DERMIS_USE_HOST_READ = 4096,
  DERMIS_USE_HOST_WRITE = 8192,
  DERMIS_USE_INDIRECT_READ = 16384
} dermis_use;

// ---- glTF. In a build without it, `dermis_model_load` fails with `DERMIS_MISSING_FEATURE`.

// What is computed for primitives without normals.
typedef enum dermis_missing_normals {
  DERMIS_NORMALS_LEAVE = 0,
  DERMIS_NORMALS_SMOOTH = 1,
  DERMIS_NORMALS_FLAT = 2,           // as glTF demands; vertices are repeated
  DERMIS_NORMALS_INT32 = 0x7fffffff  // not a value
} dermis_missing_normals;
// What to load, and how. Strings are UTF-8.
typedef struct dermis_model_source {
  uint32_t size;
  uint32_t is_strict;  // whether a broken rule is an error even if the meaning is clear
  const char* path;    // of a .gltf or .glb file; or null, and
  const void* bytes;   // the file in memory,
  size_t byte_count;
  const char* folder;      // and the folder of the files that it names; null: there are none
  const char* clips_path;  // optional: a file whose clips are added, for nodes of the same names
  uint32_t rigid_meshes;   // whether to read rigid meshes that hang on a skeleton
  dermis_missing_normals missing_normals;
} dermis_model_source;
// A file that was loaded.
typedef struct dermis_model dermis_model;
// Loads a file. If it needs more memory than there is, it fails with `DERMIS_LIMIT_EXCEEDED`.
DERMIS_C_API dermis_code dermis_model_load(const dermis_model_source* source, dermis_model** model,
                                           dermis_error* error);

// An animation.
typedef struct dermis_clip {
  const char* name;
  double duration;  // seconds
} dermis_clip;
// What a model has, valid as long as it is.
typedef struct dermis_model_info {
  uint32_t size;
  uint32_t primitive_count;  // skinned primitives of the default scene, not those that only morph
  uint32_t clip_count;
  uint32_t note_count;
  const dermis_clip* clips;
  const char* const* notes;  // what was fixed or left out, one sentence each
} dermis_model_info;
// Lists what a model has.
DERMIS_C_API dermis_code dermis_model_contents(const dermis_model* model, dermis_model_info* info,
                                               dermis_error* error);

// A skinned primitive. Pointers are valid as long as the model.
typedef struct dermis_primitive {
  uint32_t size;
  uint32_t skin;         // primitives with the same number have the same pose
  uint32_t joint_count;  // of its poses; without those that a rig drives
  // For `dermis_validate` and `dermis_pack`. If it has no influence sets, it is not skinned: draw
  // it in bind pose.
  const dermis_mesh_view* mesh;
  const uint32_t* triangles;  // 3 vertex indices each
  size_t index_count;
  const float* texcoords;  // TEXCOORD_0, 2 per vertex, or null
  const float* colors;     // COLOR_0, 4 per vertex, or null
  float base_color[4];     // of its material, linear
} dermis_primitive;
// Describes skinned primitive number `index`.
DERMIS_C_API dermis_code dermis_model_primitive(const dermis_model* model, uint32_t index,
                                                dermis_primitive* primitive, dermis_error* error);

enum { DERMIS_REST_POSE = 0x7fffffff };  // as a clip
// Gets the joint matrices of a primitive at a time of a clip, in seconds, which is clamped; and the
// weights of all its morph targets, unless `morph_weights` is null and its count 0. The counts must
// be those of the primitive and of its mesh view.
DERMIS_C_API dermis_code dermis_model_pose(const dermis_model* model, uint32_t primitive,
                                           uint32_t clip, double time, dermis_joint* joints,
                                           uint32_t joint_count, float* morph_weights,
                                           uint32_t morph_weight_count, dermis_error* error);

// ---- Clips (clips.h): animations packed into a bank, from which poses are sampled, by the scene
// or by `dermis_sample_pose`.

// How values between two keys are computed, as in glTF 2.0.
typedef enum dermis_interpolation {
  DERMIS_INTERPOLATION_STEP = 0,
  DERMIS_INTERPOLATION_LINEAR = 1,
  DERMIS_INTERPOLATION_CUBIC_SPLINE = 2,
  DERMIS_INTERPOLATION_INT32 = 0x7fffffff  // not a value
} dermis_interpolation;
// What a channel animates.
typedef enum dermis_channel_path {
  DERMIS_CHANNEL_TRANSLATION = 0,
  DERMIS_CHANNEL_ROTATION = 1,
  DERMIS_CHANNEL_SCALE = 2,
  DERMIS_CHANNEL_WEIGHTS = 3,             // morph weights
  DERMIS_CHANNEL_PATH_INT32 = 0x7fffffff  // not a value
} dermis_channel_path;

// A node of a skeleton, at rest, relative to its parent.
typedef struct dermis_node {
  uint32_t size;
  uint32_t parent;   // 1 + its index; 0: none
  const char* name;  // for messages only
  double translation[3];
  double rotation[4];  // a quaternion: x, y, z, w; 0 0 0 0 counts as 0 0 0 1
  double scale[3];     // 0 0 0 counts as 1 1 1; to hide a node: 1e-300, which is 0 in float32
  const double*
      matrix;  // or null. 3 rows of 4, in place of the three above; no clip may animate it
  const float* weights;   // morph weights at rest
  uint32_t weight_count;  // as its mesh has morph targets
} dermis_node;
// The joints of a skin, as a pose has them.
typedef struct dermis_skin {
  uint32_t size;
  uint32_t joint_count;
  const char* name;                  // for messages only
  const uint32_t* joints;            // indices of nodes
  const dermis_joint* inverse_bind;  // one for each joint
} dermis_skin;
// One animated property of one node.
typedef struct dermis_channel {
  uint32_t size;
  uint32_t node;
  dermis_channel_path path;
  dermis_interpolation interpolation;
  const float* times;  // seconds, not descending. If two are equal, the value jumps there
  // 3 for each key, or 4 for rotations, or for weights as many as the node has; three times as many
  // for splines: in-tangent, value, out-tangent.
  const float* values;
  uint32_t key_count;    // at least 1
  uint32_t value_count;  // numbers
} dermis_channel;
// A clip.
typedef struct dermis_clip_view {
  uint32_t size;
  uint32_t channel_count;
  const char* name;  // for messages only
  double duration;   // seconds
  const dermis_channel* channels;
  uint32_t is_clamped;   // 0: its time wraps
  uint32_t is_additive;  // whether it is added to others, as its difference from
  uint32_t base_clip;    // this clip, 1 + its index, or 0: the rest pose
  double base_time;      // at this time
} dermis_clip_view;
// What a bank is made of.
typedef struct dermis_clips_source {
  uint32_t size;
  uint32_t node_count, skin_count, clip_count, mask_count;
  const dermis_node* nodes;
  const dermis_skin* skins;
  const dermis_clip_view* clips;
  const float* masks;  // for each mask a factor from 0 to 1 for each node; 0 below 2^-60
  // How far anything that a joint moves may be from where the clips have it; 0: 1/10,000 of the
  // extent of the skeleton.
  double max_error;
  const dermis_mesh_view* meshes;  // of each skin: how far it reaches; null: as far as its joints
  double max_weight_error;         // how far a morph weight may be from the clips'; 0: 1/1000
  // Takes the motion of a node over the ground out of the clips: 1 + its index; 0: of none.
  uint32_t root_motion_node;
  uint32_t up_axis;  // of the ground: 1: x, 2: y, 3: z; 0: y
} dermis_clips_source;
// Lists the skeleton and the clips of a model, as a source that the caller may change. It is valid
// as long as the model.
DERMIS_C_API dermis_code dermis_model_clips(const dermis_model* model, dermis_clips_source* source,
                                            dermis_error* error);

// A bank of clips. It can be stored with the assets. Any number of threads may use it.
typedef struct dermis_bank dermis_bank;
// Packs clips, at import.
DERMIS_C_API dermis_code dermis_pack_clips(const dermis_clips_source* source, dermis_bank** bank,
                                           dermis_error* error);
// Makes a bank from stored bytes, which it copies and checks.
DERMIS_C_API dermis_code dermis_bank_load(const void* bytes, size_t byte_count, dermis_bank** bank,
                                          dermis_error* error);

// What is known of a packed clip.
typedef struct dermis_clip_info {
  float duration;  // seconds
  uint32_t is_clamped, is_additive;
} dermis_clip_info;
// How far a bank may be from its clips at any time (clips.h, `ClipError`).
typedef struct dermis_clip_error {
  float translation;  // distance
  float rotation;     // radians
  float scale;        // of each factor
  float weight;       // of each morph weight
} dermis_clip_error;
// What is known of a bank. Pointers are valid as long as it.
typedef struct dermis_bank_info {
  uint32_t size;
  uint32_t node_count;  // that clips move
  const void* bytes;    // the blob
  uint64_t byte_count;  // of the blob
  uint32_t skin_count, clip_count, mask_count;
  const uint32_t* joint_counts;   // of each skin
  const dermis_clip_info* clips;  // of each clip
  // What `dermis_pack_clips` reports; zeros if the bank was loaded from bytes.
  double worst_error, max_error;      // of whole poses, and what was asked for
  double slowest_rate, fastest_rate;  // keys a second of tracks with keys
  uint64_t key_count;
  uint32_t animated_tracks, constant_tracks;  // with keys, and with one value
  const char* worst;                          // where the error is: clip, node and time
  uint32_t has_root_motion;                   // whether it was taken out of the clips
  dermis_clip_error root_motion_error;        // of the motion from a clip's beginning
  // The nodes of the skeleton with morph weights, and how many each has.
  uint32_t morphed_node_count;
  const uint32_t* morphed_nodes;
  const uint32_t* weight_counts;
} dermis_bank_info;
// Says what is known of a bank.
DERMIS_C_API dermis_code dermis_bank_contents(const dermis_bank* bank, dermis_bank_info* info,
                                              dermis_error* error);
// Gets the error of the local transform of a node of the skeleton, and of its morph weights. It is
// 0 where no clip moves it.
DERMIS_C_API dermis_code dermis_node_error(const dermis_bank* bank, uint32_t node,
                                           dermis_clip_error* result, dermis_error* error);

// What takes part in a pose. Weights are relative; layers of additive clips are added.
typedef struct dermis_clip_layer {
  double time;    // seconds; wrapped or clamped as the clip says
  float weight;   // required: 0 does nothing
  uint32_t clip;  // its number in the bank
  uint32_t mask;  // 1 + its number in the source; 0: none
  uint32_t hold;  // whether the time is clamped, although the clip wraps
} dermis_clip_layer;
// Gets the time of a layer inside its clip, as it is sampled: in seconds, wrapped or clamped.
DERMIS_C_API dermis_code dermis_clip_time(const dermis_bank* bank, uint32_t clip, double time,
                                          uint32_t hold, float* result, dermis_error* error);
// Samples the pose of a skin of at most 4 layers. Without layers it rests. The same bits on every
// processor.
DERMIS_C_API dermis_code dermis_sample_pose(const dermis_bank* bank,
                                            const dermis_clip_layer* layers, uint32_t layer_count,
                                            uint32_t skin, dermis_joint* joints,
                                            uint32_t joint_count, dermis_error* error);
// Samples the morph weights of a node of the skeleton in the same way: as many as were packed.
DERMIS_C_API dermis_code dermis_sample_weights(const dermis_bank* bank,
                                               const dermis_clip_layer* layers,
                                               uint32_t layer_count, uint32_t node, float* weights,
                                               uint32_t weight_count, dermis_error* error);
// Gets the motion over the ground that was taken out of a clip, between two times: how far a figure
// moves, in its frame at the first one, and how far it turns about the up axis, in radians. Each
// loop begins where the one before ended. `hold`: times are clamped, although the clip wraps.
DERMIS_C_API dermis_code dermis_root_motion(const dermis_bank* bank, uint32_t clip, double from,
                                            double to, uint32_t hold, double displacement[3],
                                            double* turn, dermis_error* error);

// Computes a box that contains a mesh of a skin at all times of a clip: once, at import. It is
// infinite as that of `dermis_skinned_box`.
DERMIS_C_API dermis_code dermis_clip_box(const dermis_bank* bank, uint32_t clip, uint32_t skin,
                                         const dermis_joint_bounds* bounds, dermis_method method,
                                         dermis_promise promise, dermis_box* box,
                                         dermis_error* error);
// The same for any blend of clips that are not additive.
DERMIS_C_API dermis_code dermis_blend_box(const dermis_bank* bank, const uint32_t* clips,
                                          uint32_t clip_count, uint32_t skin,
                                          const dermis_joint_bounds* bounds, dermis_method method,
                                          dermis_promise promise, dermis_box* box,
                                          dermis_error* error);

// Adds a bank to a scene, which keeps its bytes: it may then be destroyed.
DERMIS_C_API dermis_code dermis_add_clips(dermis_scene* scene, const dermis_bank* bank,
                                          dermis_clips* clips, dermis_error* error);
// Fails if a figure uses it.
DERMIS_C_API dermis_code dermis_remove_clips(dermis_scene* scene, dermis_clips clips,
                                             dermis_error* error);
// Adds figures, which rest until they play. `rigs` are those of their poses, one or zeros for each
// skin of the bank; `rig_count` may be 0. If it fails, it adds none; what those before the failure
// took is free when the frame is complete.
DERMIS_C_API dermis_code dermis_add_figures(dermis_scene* scene, dermis_clips clips,
                                            const dermis_rig* rigs, uint32_t rig_count,
                                            uint32_t count, dermis_figure* figures,
                                            dermis_error* error);
// Removes a figure and its poses. Fails if an instance uses one of them.
DERMIS_C_API dermis_code dermis_remove_figure(dermis_scene* scene, dermis_figure figure,
                                              dermis_error* error);
// Gets the pose of a figure for a skin of its bank, which the scene samples.
DERMIS_C_API dermis_code dermis_figure_pose(const dermis_scene* scene, dermis_figure figure,
                                            uint32_t skin, dermis_pose* pose, dermis_error* error);

// What a figure plays from now on. Layers are copied.
typedef struct dermis_play {
  dermis_figure figure;
  uint32_t layer_count;  // at most 4; 0: it rests
  const dermis_clip_layer* layers;
} dermis_play;
// Sets what figures play, at any time. If it fails, nothing changes, and the message begins with
// "entry " and the index of the first that is wrong.
DERMIS_C_API dermis_code dermis_play_clips(dermis_scene* scene, const dermis_play* plays,
                                           uint32_t count, dermis_error* error);

// ---- Rigs (rig.h): joints and morph weights that follow from the joints of a pose, computed by
// the scene or by `dermis_evaluate_rig`. First come the written joints, then those that drivers
// compute; meshes number them in this order. In the same way, first come the weights that are given
// with a pose, then those that correctives compute.

// A joint of a rig.
typedef struct dermis_rig_joint {
  uint32_t parent;    // 1 + its index; 0: none
  dermis_joint bind;  // required: its global transform in bind pose
} dermis_rig_joint;
// A joint that takes a share of the twist of another one.
typedef struct dermis_twist {
  uint32_t size;
  uint32_t joint;  // driven
  uint32_t source;
  float axis[3];  // required: in the axes of `source`, of any length
  float share;    // from -1 to 1
} dermis_twist;
// How a driven joint is moved from its bind pose, in its own axes.
typedef struct dermis_joint_offset {
  float translation[3];
  float rotation[4];  // a quaternion: x, y, z, w, of any length; 0 0 0 0 counts as 0 0 0 1
  float scale[3];     // 0 0 0 counts as 1 1 1
} dermis_joint_offset;
// Weights and joint offsets that are given for example poses of some joints.
typedef struct dermis_corrective {
  uint32_t size;
  uint32_t input_count, example_count;  // required; at most 64 examples
  uint32_t first_weight, weight_count;  // that it drives
  uint32_t joint_count;
  const uint32_t* inputs;  // joints
  // For each example, for each input: its rotation relative to its parent and to the bind pose, a
  // quaternion x, y, z, w of any length.
  const float* rotations;
  const float* weights;                // for each example: `weight_count` of them
  const uint32_t* joints;              // driven
  const dermis_joint_offset* offsets;  // for each example: one for each of `joints`
  float radius;                        // of Gaussian functions, about an angle; 0: linear ones
} dermis_corrective;
// Joints along a curve through a chain of joints, one at each end of a segment but the ends of the
// chain.
typedef struct dermis_chain {
  uint32_t size;
  uint32_t joint_count;    // required: at least 2
  const uint32_t* joints;  // from one end to the other
  uint32_t first_driven;   // of `segments` - 1 consecutive joints
  uint32_t segments;       // required: at least 2
} dermis_chain;
// A joint whose matrix is that of its parent × (1 + the sum of weights × matrices).
typedef struct dermis_linear {
  uint32_t size;
  uint32_t joint;           // driven
  const uint32_t* weights;  // their numbers
  const dermis_joint* matrices;
  uint32_t count;  // of both
} dermis_linear;
// What a rig is made of. Drivers may be in any order.
typedef struct dermis_rig_source {
  uint32_t size;
  uint32_t joint_count, written_joints;  // required
  uint32_t given_weights, driven_weights;
  uint32_t weights_of;  // for figures: the node whose morph weights are the given ones
  const dermis_rig_joint* joints;
  const dermis_twist* twists;
  const dermis_corrective* correctives;
  const dermis_chain* chains;
  const dermis_linear* linears;
  uint32_t twist_count, corrective_count, chain_count, linear_count;
} dermis_rig_source;

// A rig that a scene can have. It can be stored with the assets.
typedef struct dermis_packed_rig dermis_packed_rig;
// Packs a rig, at import. Refuses what `packRig` in rig.h does.
DERMIS_C_API dermis_code dermis_pack_rig(const dermis_rig_source* source, dermis_packed_rig** rig,
                                         dermis_error* error);
// Makes a rig from stored bytes, which it copies and checks.
DERMIS_C_API dermis_code dermis_packed_rig_load(const void* bytes, size_t byte_count,
                                                dermis_packed_rig** rig, dermis_error* error);
// Reads a rig of a skin of a glTF model, JSON as docs/rigs.md describes it, and applies it to the
// model, once for a skin: primitives get the joint numbers of the rig, so `dermis_pack` needs
// written and driven joints, and the morph targets that it drives come last. `json`: null means
// what the file has. No other thread may use the model meanwhile. What was got from it before is
// invalid after a success.
DERMIS_C_API dermis_code dermis_model_apply_rig(dermis_model* model, uint32_t skin,
                                                const char* json, dermis_packed_rig** rig,
                                                dermis_error* error);
// What is known of a packed rig.
typedef struct dermis_packed_rig_info {
  uint32_t size;
  uint32_t written_joints, driven_joints;
  uint32_t given_weights, driven_weights;
  uint32_t weights_of;  // 0xffffffff if there are no given weights
  const void* bytes;    // the blob, valid as long as the rig
  uint64_t byte_count;  // of the blob
  uint32_t is_rigid;    // whether driven joints are rigid whenever the written ones are
  float residual;       // by how much a corrective misses the values of an example at most
} dermis_packed_rig_info;
// Says what is known of a packed rig.
DERMIS_C_API dermis_code dermis_packed_rig_contents(const dermis_packed_rig* rig,
                                                    dermis_packed_rig_info* info,
                                                    dermis_error* error);
// Computes the driven joints and all weights, the given ones first. The counts must be those of the
// rig.
DERMIS_C_API dermis_code dermis_evaluate_rig(const dermis_packed_rig* rig,
                                             const dermis_joint* written, uint32_t written_count,
                                             const float* given_weights, uint32_t given_count,
                                             dermis_joint* driven, uint32_t driven_count,
                                             float* weights, uint32_t weight_count,
                                             dermis_error* error);
// Binds a mesh to a chain of a rig: what its joints move follows the two ends of the nearest
// segment. `view` and `repaired` as for `dermis_repair`; it may be bound to another chain, and
// packed for all joints of the rig.
DERMIS_C_API dermis_code dermis_bend_chain(const dermis_mesh_view* mesh,
                                           const dermis_rig_joint* joints, uint32_t joint_count,
                                           const dermis_chain* chain, dermis_mesh_view* view,
                                           dermis_repaired** repaired, dermis_error* error);

// Adds a rig to a scene, which keeps its bytes: it may then be destroyed.
DERMIS_C_API dermis_code dermis_add_rig(dermis_scene* scene, const dermis_packed_rig* packed,
                                        dermis_rig* rig, dermis_error* error);
// Fails if a pose has it.
DERMIS_C_API dermis_code dermis_remove_rig(dermis_scene* scene, dermis_rig rig,
                                           dermis_error* error);
// `dermis_write_poses` for the given weights of poses: both return memory of the same poses, and
// the engine writes both. `weight_counts` may be null; without a rig a count is 0.
DERMIS_C_API dermis_code dermis_write_pose_weights(dermis_scene* scene, const dermis_pose* poses,
                                                   uint32_t count, float** weights,
                                                   uint32_t* weight_counts, dermis_error* error);

// ---- Vulkan. Define DERMIS_VULKAN, or include vulkan_core.h before. No loader is linked.

#ifdef VULKAN_CORE_H_

// Stages and accesses of both sides of a barrier.
typedef struct dermis_barrier {
  VkPipelineStageFlags source_stages;
  VkAccessFlags source_accesses;
  VkPipelineStageFlags destination_stages;
  VkAccessFlags destination_accesses;
} dermis_barrier;
// Which half of a queue-family ownership transfer a barrier is.
typedef enum dermis_transfer {
  DERMIS_TRANSFER_NONE = 0,
  DERMIS_TRANSFER_RELEASE = 1,
  DERMIS_TRANSFER_ACQUIRE = 2,
  DERMIS_TRANSFER_INT32 = 0x7fffffff  // not a value
} dermis_transfer;
// The barrier between two uses, each of `dermis_use`, for engines that record it themselves.
DERMIS_C_API dermis_code dermis_barrier_between(uint32_t before, uint32_t after,
                                                dermis_transfer transfer, dermis_barrier* barrier,
                                                dermis_error* error);

// Answers of the engine to a question for which Dermis has a default.
typedef enum dermis_choice {
  DERMIS_CHOICE_DEFAULT = 0,
  DERMIS_CHOICE_NO = 1,
  DERMIS_CHOICE_YES = 2,
  DERMIS_CHOICE_INT32 = 0x7fffffff  // not a value
} dermis_choice;
// The engine's device and what the engine enabled on it. It must have Vulkan 1.1 and a queue for
// compute; no extension or feature is needed. Two features make kernels for CPU devices faster.
typedef struct dermis_device_desc {
  uint32_t size;
  uint32_t api_version;  // required: of VkApplicationInfo, or of the device if that is lower
  VkInstance instance;   // required
  VkPhysicalDevice physical_device;                  // required
  VkDevice device;                                   // required
  PFN_vkGetInstanceProcAddr get_instance_proc_addr;  // required
  const char* const* extensions;                     // enabled
  const void* features;                              // pNext chain of VkDeviceCreateInfo, or null
  uint32_t extension_count;
  uint32_t has_scalar_block_layout;  // whether these features are enabled, without the chain
  uint32_t has_shader_int64;
  dermis_choice texel_buffers;  // whether kernels are those for CPU devices
  dermis_choice staged_stores;  // whether kernels may store interleaved vertices widely
  VkPipelineCache pipeline_cache;
  const VkAllocationCallbacks* allocator;  // must outlive the context
  // Optional: the engine's own build of the kernels. `words` must stay valid until the next call in
  // the same thread.
  void* user;
  dermis_code (*get_kernel)(void* user, const char* module, const uint32_t** words,
                            size_t* word_count, dermis_error* error);
} dermis_device_desc;
// Layouts and pipelines on one device. Destroy it before the device, and after what uses it.
typedef struct dermis_context dermis_context;
// `limits` and `tuning` are for batches, and may be null.
DERMIS_C_API dermis_code dermis_context_create(const dermis_device_desc* desc,
                                               dermis_limits* limits, dermis_tuning* tuning,
                                               dermis_context** context, dermis_error* error);
// Builds every pipeline that instances like this one can need. Call it before such an instance is
// recorded. `scene` and `desc` as for `dermis_list_pipelines`; the tuning is that of the recorder,
// without a scene that of the context. May take long. Without a scene, any thread may call it.
DERMIS_C_API dermis_code dermis_prepare(const dermis_context* context, const dermis_scene* scene,
                                        const dermis_instance_desc* desc, dermis_error* error);
// Builds these pipelines of `dermis_list_pipelines`: before `dermis_record_plan`, if a plan was
// made with another tuning than the context's. Any thread may call it.
DERMIS_C_API dermis_code dermis_prepare_pipelines(const dermis_context* context,
                                                  const uint64_t* pipelines, uint32_t count,
                                                  dermis_error* error);
// Records a barrier for all memory between two uses, outside a render pass: before `dermis_record`
// between the last use of the output and `DERMIS_USE_DERMIS`, and after it between that and the
// next use. To read vertices back by a copy, also from `COPY_WRITE` to `HOST_READ` after the copy.
DERMIS_C_API dermis_code dermis_record_barrier(const dermis_context* context,
                                               VkCommandBuffer command_buffer, uint32_t before,
                                               uint32_t after, dermis_error* error);

// A part of a buffer.
typedef struct dermis_range {
  VkBuffer buffer;
  VkDeviceSize offset;
  VkDeviceSize byte_count;  // a multiple of 4
} dermis_range;
// The buffers of a batch; what no job needs may be left out.
typedef struct dermis_batch_buffers {
  uint32_t size;
  dermis_range meshes, poses, tables, palettes, results;
  dermis_range outputs[4];  // by `dermis_stream`; the same four times if attributes share one
} dermis_batch_buffers;
// Descriptor sets for a set of buffers. Destroy them before the buffers and the context, once the
// GPU has completed what was recorded with them.
typedef struct dermis_bindings dermis_bindings;
// Creates them. Ranges must be aligned as `dermis_plan_contents` says.
DERMIS_C_API dermis_code dermis_bindings_create(const dermis_context* context,
                                                const dermis_batch_buffers* buffers,
                                                dermis_bindings** bindings, dermis_error* error);
// Records the commands of a plan. The engine records the barriers before and after.
DERMIS_C_API dermis_code dermis_record_plan(const dermis_context* context,
                                            VkCommandBuffer command_buffer, const dermis_plan* plan,
                                            const dermis_bindings* bindings, dermis_error* error);

// Who uses the memory of a buffer.
typedef enum dermis_memory_use {
  DERMIS_MEMORY_DEVICE = 0,         // the GPU
  DERMIS_MEMORY_UPLOAD = 1,         // the CPU writes, the GPU reads: mapped, host-coherent
  DERMIS_MEMORY_READ_BACK = 2,      // the GPU writes, the CPU reads: mapped, host-coherent
  DERMIS_MEMORY_INT32 = 0x7fffffff  // not a value
} dermis_memory_use;
// A buffer with its memory.
typedef struct dermis_created_buffer {
  VkBuffer buffer;
  void* mapped;
  void* allocation;  // for `destroy_buffer`
} dermis_created_buffer;
// What a recorder needs to know. Ranges are optional parts of the engine's buffers; they do not
// grow. `dermis_recorder_requirement` says what they need.
typedef struct dermis_recorder_desc {
  uint32_t size;
  VkBufferUsageFlags output_usage;  // of the engine, if created here; 0: VERTEX_BUFFER
  const dermis_scene_desc* scene;   // null: the defaults
  const dermis_tuning* tuning;      // null: that of the context
  dermis_range meshes, poses, gpu_poses, output;
  void* mapped_poses;          // address of the first byte of `poses`
  uint32_t measures_gpu_time;  // by timestamps
  // The engine's allocator: both or none. `name` is static.
  void* user;
  dermis_code (*create_buffer)(void* user, const VkBufferCreateInfo* info, dermis_memory_use use,
                               const char* name, dermis_created_buffer* buffer,
                               dermis_error* error);
  void (*destroy_buffer)(void* user, const dermis_created_buffer* buffer);
} dermis_recorder_desc;
// What a range that is given to `dermis_recorder_create` needs: usage, alignment, and the size for
// the initial capacity. `role` is MESHES, POSES, GPU_POSES or OUTPUT. `layouts` are those of the
// instances, and may be null.
DERMIS_C_API dermis_code dermis_recorder_requirement(
    const dermis_context* context, const dermis_recorder_desc* desc, dermis_buffer_role role,
    const dermis_layout* layouts, uint32_t layout_count, dermis_requirement* requirement,
    dermis_error* error);
// Owns a scene and its buffers, and records its frames. Destroy it once the GPU has completed them.
typedef struct dermis_recorder dermis_recorder;
// `desc` may be null.
DERMIS_C_API dermis_code dermis_recorder_create(const dermis_context* context,
                                                const dermis_recorder_desc* desc,
                                                dermis_recorder** recorder, dermis_error* error);
// Valid until the recorder is destroyed. Null if `recorder` is null.
DERMIS_C_API dermis_scene* dermis_recorder_scene(dermis_recorder* recorder);
// Records the frame, outside a render pass. `visibility` is the buffer of visibility words, if
// instances are culled on the GPU; otherwise VK_NULL_HANDLE. `visibility_offset` is in bytes, a
// multiple of the device's alignment of storage buffers.
DERMIS_C_API dermis_code dermis_record(dermis_recorder* recorder, VkCommandBuffer command_buffer,
                                       VkBuffer visibility, VkDeviceSize visibility_offset,
                                       dermis_error* error);
// As of the last frame that was recorded.
typedef struct dermis_recorder_info {
  uint32_t size;
  uint32_t dispatches;
  VkBuffer output_buffer;      // offsets of outputs count from its beginning
  uint64_t output_generation;  // changes when `output_buffer` becomes another one
  uint64_t workgroups, uploaded_bytes, device_memory;
  double plan_seconds, record_seconds;
  double gpu_seconds;  // of the newest complete frame; negative if it was not measured
} dermis_recorder_info;
// Says where the output is, and what the last frame cost.
DERMIS_C_API dermis_code dermis_recorder_contents(const dermis_recorder* recorder,
                                                  dermis_recorder_info* info, dermis_error* error);
// Where a GPU pass of the engine writes the joint matrices of a pose, and behind them the given
// weights of its rig.
DERMIS_C_API dermis_code dermis_pose_range(const dermis_recorder* recorder, dermis_pose pose,
                                           dermis_range* range, dermis_error* error);
// The same for the morph weights of an instance: a float for each target of its mesh that no rig
// drives.
DERMIS_C_API dermis_code dermis_weights_range(const dermis_recorder* recorder,
                                              dermis_instance instance, dermis_range* range,
                                              dermis_error* error);
// The same as `dermis_commands_driven_part`.
DERMIS_C_API dermis_code dermis_driven_range(const dermis_recorder* recorder, dermis_pose pose,
                                             dermis_range* range, dermis_error* error);

#endif  // VULKAN_CORE_H_

// ---- The reference, in a separate library, `dermis_compare`. It tells whether skinned vertices
// are right. Use it in tests and debug builds: it is written to be correct, not fast. verify.h
// describes the reference and its bounds.

// What that library exports.
#if defined(DERMIS_STATIC) || defined(DERMIS_CDEF)
#define DERMIS_COMPARE_API
#elif defined(_WIN32) && defined(DERMIS_BUILDS_C_COMPARE)
#define DERMIS_COMPARE_API __declspec(dllexport)
#elif defined(_WIN32)
#define DERMIS_COMPARE_API __declspec(dllimport)
#else
#define DERMIS_COMPARE_API __attribute__((visibility("default")))
#endif

// Layers of clips.
typedef struct dermis_sampled_clips {
  uint32_t size;
  uint32_t layer_count;
  const dermis_clips_source* source;  // required; its errors and meshes are ignored
  const dermis_clip_layer* layers;
  const void* bank;  // the blob that was made of the source, for bounds; null: none
  size_t bank_byte_count;
} dermis_sampled_clips;
// A mesh in a pose. The reference always applies scale: for a pose that ignores it, pass joints
// without. For previous positions, pass the joints of the frame before, and their places as
// positions.
typedef struct dermis_posed_mesh {
  uint32_t size;
  uint32_t joint_count;
  const dermis_mesh_view* mesh;  // required; one that `dermis_pack` accepts
  const dermis_joint* joints;    // required without `clips`
  const dermis_morph_weight* morphs;
  uint32_t morph_count;
  dermis_method method;
  // In place of joints: the pose of this skin in the source of a bank, which is required. The
  // bounds are those for vertices that a device skins in the bank's pose.
  const dermis_sampled_clips* clips;
  uint32_t skin;
} dermis_posed_mesh;

// Skins a mesh in double precision: 3 numbers for each position and normal, 4 for each tangent. The
// counts are those of the numbers. An array may be null. Fails if there is an array for normals or
// tangents and the mesh has none.
DERMIS_COMPARE_API dermis_code dermis_reference_skin(const dermis_posed_mesh* posed,
                                                     double* positions, size_t position_count,
                                                     double* normals, size_t normal_count,
                                                     double* tangents, size_t tangent_count,
                                                     dermis_error* error);

// One attribute of skinned vertices in memory. Needs no alignment.
typedef struct dermis_skinned_attribute {
  const void* data;  // of vertex 0; null if it is absent
  uint32_t stride;   // bytes; 0: that of its format
  dermis_format format;
} dermis_skinned_attribute;
// The vertices that are compared.
typedef struct dermis_skinned_view {
  uint32_t size;
  uint32_t vertex_count;
  dermis_skinned_attribute positions;  // required
  dermis_skinned_attribute normals, tangents;
  dermis_box box;  // of positions in snorm16
} dermis_skinned_view;

// The result of a comparison. Errors are divided by the bound of their vertex (docs/accuracy.md),
// so that 1 is the largest permitted.
typedef struct dermis_comparison {
  uint32_t size;
  uint32_t passed;  // whether every vertex is within its bound
  double worst_position, worst_normal, worst_tangent;
  double largest_position_error;  // not divided, in the units of the pose
  uint64_t compared;              // vertices that were compared with their bound
  uint64_t failures;              // of them, outside it
  // Vertices without a bound: those whose joints are singular or antipodal, which must be finite;
  // those whose joints are not finite; and those whose numbers are out of range.
  uint64_t only_finite, skipped, out_of_range;
  uint32_t worst_position_vertex;
  uint32_t first_failure;
} dermis_comparison;
// Skins a mesh in double precision, and compares every vertex with it. If vertices are wrong, it
// succeeds, and `passed` is 0.
DERMIS_COMPARE_API dermis_code dermis_compare(const dermis_posed_mesh* posed,
                                              const dermis_skinned_view* skinned,
                                              dermis_comparison* comparison, dermis_error* error);

// In the four functions below, arrays of double may be null, and their counts are those of the
// numbers. This one samples the pose of a skin in double precision: 12 numbers for each joint, 3
// rows of 4. `bounds` gets 3 numbers A, B and C for each joint: that of a bank moves a point p of
// bind space to at most A + B d from where it moves here, where d is the length of inverse bind
// matrix × p; and except for a rotation, its 3×3 part is at most C from that here.
DERMIS_COMPARE_API dermis_code dermis_reference_pose(const dermis_sampled_clips* sampled,
                                                     uint32_t skin, double* joints,
                                                     size_t joint_count, double* bounds,
                                                     size_t bound_count, dermis_error* error);
// Samples the morph weights of a node in the same way. `bounds`: how far those of a bank may be.
DERMIS_COMPARE_API dermis_code dermis_reference_weights(const dermis_sampled_clips* sampled,
                                                        uint32_t node, double* weights,
                                                        size_t weight_count, double* bounds,
                                                        size_t bound_count, dermis_error* error);
// Computes the motion that `dermis_root_motion` gets; layers are ignored. `motion` and `bounds` get
// 4 numbers: the displacement and the turn; and 2, how far those of a bank may be.
DERMIS_COMPARE_API dermis_code dermis_reference_motion(const dermis_sampled_clips* sampled,
                                                       uint32_t clip, double from, double to,
                                                       uint32_t hold, double motion[4],
                                                       double bounds[2], dermis_error* error);

// Computes what a rig drives in double precision: 12 numbers for each driven joint, 3 rows of 4,
// and all weights, the given ones first. Bounds have the counts of what they belong to: how far
// each number in float32 may be, infinite if rounding decides.
DERMIS_COMPARE_API dermis_code
dermis_reference_rig(const dermis_rig_source* source, const dermis_joint* written,
                     uint32_t written_count, const float* given_weights, uint32_t given_count,
                     double* joints, double* joint_bounds, size_t joint_count, double* weights,
                     double* weight_bounds, size_t weight_count, dermis_error* error);

// Well-known mistakes of engines that compute joint matrices (verify.h, `PoseMistake`).
typedef enum dermis_mistake {
  DERMIS_MISTAKE_NONE = 0,
  DERMIS_MISTAKE_UNKNOWN = 1,  // the pose is wrong, but no mistake that was tested explains it
  DERMIS_MISTAKE_TRANSPOSED = 2,
  DERMIS_MISTAKE_COLUMN_MAJOR = 3,
  DERMIS_MISTAKE_INVERSE_BIND_MISSING = 4,
  DERMIS_MISTAKE_INVERSE_BIND_TWICE = 5,
  DERMIS_MISTAKE_INVERSE_BIND_WRONG_SIDE = 6,
  DERMIS_MISTAKE_JOINTS_IN_NODE_ORDER = 7,
  DERMIS_MISTAKE_JOINTS_SORTED_BY_NAME = 8,
  DERMIS_MISTAKE_JOINTS_OFF_BY_ONE = 9,
  DERMIS_MISTAKE_ROOT_MISSING = 10,
  DERMIS_MISTAKE_ROOT_TWICE = 11,
  DERMIS_MISTAKE_UNITS = 12,
  DERMIS_MISTAKE_AXES = 13,
  DERMIS_MISTAKE_QUATERNION_ORDER = 14,
  DERMIS_MISTAKE_WEIGHT_SET = 15,
  DERMIS_MISTAKE_INT32 = 0x7fffffff  // not a value
} dermis_mistake;

// A pose, and what is known of its skeleton (verify.h, `PoseInput`). Mistakes that need what is
// null are not tested; most are certain only with the local transforms.
typedef struct dermis_pose_input {
  uint32_t size;
  uint32_t joint_count;
  const dermis_joint* joints;  // required: those that the mesh is skinned with
  const uint32_t* triangles;   // 3 vertex indices each
  size_t index_count;
  const dermis_joint* inverse_bind_matrices;  // one for each joint
  const char* const* joint_names;             // one for each joint
  const uint32_t* joint_nodes;                // the node of each joint; null: joint j is node j
  const uint32_t* parents;                    // the parent of each node; a root's does not exist
  const dermis_joint* local_transforms;       // of each node, relative to its parent
  uint32_t node_count;                        // of the last two
} dermis_pose_input;
// What was found.
typedef struct dermis_diagnosis {
  uint32_t size;
  dermis_mistake mistake;
  double stretch,
      mended_stretch;  // of edges between joints, before and after the mistake is mended
  char message[504];   // the mistake, and the line of code that mends it; empty if there is none
} dermis_diagnosis;
// Finds out whether a pose is plausible for a mesh, and if not, which mistake explains it. For
// debug builds: call it with the first pose of an instance.
DERMIS_COMPARE_API dermis_code dermis_diagnose(const dermis_mesh_view* mesh,
                                               const dermis_pose_input* input,
                                               dermis_diagnosis* diagnosis, dermis_error* error);

#ifdef __cplusplus
}
#endif
#endif
