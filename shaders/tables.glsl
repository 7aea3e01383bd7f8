// The tables of a batch and this dispatch's place in them. Needs abi.h.

layout(set = 0, binding = BINDING_TABLES, std430) readonly buffer Tables { uint tables[]; };

#ifdef TEXELS
layout(set = 0, binding = BINDING_TABLE_TEXELS) uniform utextureBuffer tableTexels;
#else
layout(set = 0, binding = BINDING_TABLES, std430) readonly buffer TableUnits { uvec4 tableUnits[]; };
#endif

// Four words of a record. Records begin at multiples of four words.
uvec4 tableUnit(uint word) {
#ifdef TEXELS
  return texelFetch(tableTexels, int(word / 4u));
#else
  return tableUnits[word / 4u];
#endif
}

layout(push_constant) uniform Push { uint push[PUSH_WORDS]; };

// Workgroups are numbered through, whatever part of the number was folded into y.
uint workgroupNumber() { return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x; }
