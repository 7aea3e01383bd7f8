// The tables of a batch and this dispatch's place in them. Needs abi.h.

layout(set = 0, binding = BINDING_TABLES, std430) restrict readonly buffer Tables { uint tables[]; };

layout(push_constant) uniform Push { uint push[PUSH_WORDS]; };

// Workgroups are numbered through, whatever part of the number was folded into y.
uint workgroupNumber() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
