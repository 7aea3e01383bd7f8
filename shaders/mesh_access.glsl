// How a packed mesh is read. Needs abi.h.

#ifdef TEXELS
layout(set = 0, binding = BINDING_MESH_TEXELS) uniform utextureBuffer meshTexels;

uint meshWord(uint word) { return texelFetch(meshTexels, int(word)).x; }
#else
layout(set = 0, binding = BINDING_MESHES, std430) restrict readonly buffer Meshes { uint meshes[]; };

uint meshWord(uint word) { return meshes[word]; }
#endif

vec3 meshVector(uint word) {
  return vec3(uintBitsToFloat(meshWord(word)), uintBitsToFloat(meshWord(word + 1u)), uintBitsToFloat(meshWord(word + 2u)));
}

// The word at which a section begins.
uint meshSection(uint mesh, uint header) { return mesh + meshWord(mesh + header); }

// The influences of one vertex. Up to four are read once, for all instances.
struct Influences {
  uint word;
  uint count;
  vec4 weights;
  uvec4 joints;
};

float readWeight(uint word, uint slot) {
  return uintBitsToFloat(meshWord(word + slot * INFLUENCE_WORDS + INFLUENCE_WEIGHT));
}

uint readJoint(uint word, uint slot) { return meshWord(word + slot * INFLUENCE_WORDS + INFLUENCE_JOINT); }

Influences influencesOf(uint mesh, uint vertex) {
  uint firsts = meshSection(mesh, MESH_HEADER_FIRSTS) + vertex;
  uint first = meshWord(firsts);
  Influences influences;
  influences.word = meshSection(mesh, MESH_HEADER_INFLUENCES) + first * INFLUENCE_WORDS;
  influences.count = meshWord(firsts + 1u) - first;
  influences.weights = vec4(0.0);
  influences.joints = uvec4(0u);
  if (INFLUENCES != 0u) {
    influences.count = min(influences.count, INFLUENCES);
    for (uint slot = 0u; slot < INFLUENCES; ++slot) {
      if (slot >= influences.count) break;
      influences.weights[slot] = readWeight(influences.word, slot);
      influences.joints[slot] = readJoint(influences.word, slot);
    }
  }
  return influences;
}

float influenceWeight(Influences influences, uint slot) {
  return INFLUENCES != 0u ? influences.weights[slot] : readWeight(influences.word, slot);
}

uint influenceJoint(Influences influences, uint slot) {
  return INFLUENCES != 0u ? influences.joints[slot] : readJoint(influences.word, slot);
}

// What some methods want to know of a vertex besides.
struct MethodInputs {
  vec3 center;
  float share;  // of dual quaternions, or the strength of bulge control
};

float meshShare(uint mesh, uint vertex, uint values, uint value) {
  uint section = meshWord(mesh + values);
  return uintBitsToFloat(section == 0u ? meshWord(mesh + value) : meshWord(mesh + section + vertex));
}

MethodInputs methodInputsOf(uint mesh, uint vertex) {
  MethodInputs inputs = MethodInputs(vec3(0.0), 0.0);
  if (METHOD == METHOD_CENTER_OF_ROTATION || METHOD == METHOD_BULGE_CONTROLLED) {
    inputs.center = meshVector(meshSection(mesh, MESH_HEADER_CENTERS) + vertex * 3u);
  }
  if (METHOD == METHOD_BULGE_CONTROLLED) {
    inputs.share = meshShare(mesh, vertex, MESH_HEADER_BULGE_STRENGTHS, MESH_HEADER_BULGE_STRENGTH);
  }
  if (METHOD == METHOD_BLENDED) {
    inputs.share = meshShare(mesh, vertex, MESH_HEADER_DUAL_QUATERNION_WEIGHTS, MESH_HEADER_DUAL_QUATERNION_WEIGHT);
  }
  return inputs;
}
