// What is left of a joint's 3×3 C beside its rotation R.
#ifndef DERMIS_SCALE_SHEAR_GLSL
#define DERMIS_SCALE_SHEAR_GLSL

// The symmetric matrix S of C = R S.
struct ScaleShear {
  vec3 diagonal;  // xx yy zz
  vec3 mixed;     // xy xz yz
};

#endif
