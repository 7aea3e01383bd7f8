// The scale and shear part of a joint.
#ifndef DERMIS_SCALE_SHEAR_GLSL
#define DERMIS_SCALE_SHEAR_GLSL

// The symmetric matrix S of C = R S, where C is the 3×3 matrix of the joint and R its rotation.
struct ScaleShear {
  vec3 diagonal;  // xx, yy, zz
  vec3 mixed;     // xy, xz, yz
};

#endif
