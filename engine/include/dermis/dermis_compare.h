// The C interface of the reference: the library `dermis_compare`. C99. It says whether vertices,
// poses and what rigs drive are right, and is for tests and debug builds: it is written to be
// correct, not fast. The rules of dermis.h hold. verify.h describes the reference and the bounds.
#ifndef DERMIS_DERMIS_COMPARE_H
#define DERMIS_DERMIS_COMPARE_H

#include "dermis/dermis.h"

// What the library exports.
#if defined(DERMIS_STATIC) || defined(DERMIS_CDEF)
#define DERMIS_COMPARE_API
#elif defined(_WIN32) && defined(DERMIS_BUILDS_C_COMPARE)
#define DERMIS_COMPARE_API __declspec(dllexport)
#elif defined(_WIN32)
#define DERMIS_COMPARE_API __declspec(dllimport)
#else
#define DERMIS_COMPARE_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
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
