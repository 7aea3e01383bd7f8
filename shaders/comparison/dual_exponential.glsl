// Logarithm and exponential of unit dual quaternions (Kavan et al. 2008, appendix). They use polynomials instead of built-in sine
// and arc tangent, whose accuracy differs between drivers.
#ifndef DERMIS_DUAL_EXPONENTIAL_GLSL
#define DERMIS_DUAL_EXPONENTIAL_GLSL

#include "../exact.glsl"

// The logarithm of a unit dual quaternion. `real`: half the angle times the direction of the screw axis. `dual`: half the distance
// along the axis times its direction, plus half the angle times its moment.
struct Screw {
  vec3 real;
  vec3 dual;
};

// θ / sin θ for the angle θ from 0 to π with this sine and cosine. If the cosine is not negative, tan(θ/4) is at most √2 − 1. Close to π
// the logarithm has no limit, and only has to be finite: sines there count as 1/16.
float angleOverSine(float sine, float cosine) {
  float upright = abs(cosine);
  precise float halfway = quotient(sine, 1.0 + upright);
  precise float root = 1.0 + squareRoot(1.0 + halfway * halfway);
  precise float quarter = quotient(halfway, root);
  precise float z = quarter * quarter;
  precise float series =
      1.0 -
      z * (1.0 / 3.0 -
           z * (1.0 / 5.0 -
                z * (1.0 / 7.0 - z * (1.0 / 9.0 - z * (1.0 / 11.0 - z * (1.0 / 13.0 - z * (1.0 / 15.0 - z * (1.0 / 17.0))))))));
  precise float factor = quotient(4.0 * series, (1.0 + upright) * root);
  if (cosine >= 0.0) return factor;
  precise float obtuse = quotient(3.14159265358979 - sine * factor, max(sine, 0.0625));
  return obtuse;
}

Screw screwOf(vec4 real, vec4 dual) {
  precise float square = dot3(real.xyz, real.xyz);
  float sine = squareRoot(square);
  float factor = angleOverSine(sine, real.w);
  // (1 − θ cot θ) / sin² θ. Small angles use the series, since the difference would cancel.
  precise float slope;
  if (square < 0.25 && real.w > 0.0) {
    precise float s = square;
    slope =
        (1.0 / 3.0) *
        (1.0 + (2.0 / 5.0) * s *
                   (1.0 + (4.0 / 7.0) * s *
                              (1.0 + (6.0 / 9.0) * s *
                                         (1.0 + (8.0 / 11.0) * s *
                                                    (1.0 + (10.0 / 13.0) * s *
                                                               (1.0 + (12.0 / 15.0) * s *
                                                                          (1.0 + (14.0 / 17.0) * s *
                                                                                     (1.0 + (16.0 / 19.0) * s *
                                                                                                (1.0 + (18.0 / 21.0) * s)))))))));
  } else {
    slope = quotient(1.0 - factor * real.w, max(square, 0.00390625));
  }
  precise vec3 turn = factor * real.xyz;
  precise vec3 shift = factor * dual.xyz - (slope * dual.w) * real.xyz;
  return Screw(turn, shift);
}

// The unit dual quaternion of a screw whose half angle is at most π.
void exponentialOf(Screw screw, out vec4 real, out vec4 dual) {
  precise float square = dot3(screw.real, screw.real);
  precise float h = 0.25 * square;  // half the half angle, squared
  precise float sinc =
      1.0 -
      (1.0 / 6.0) * h *
          (1.0 - (1.0 / 20.0) * h *
                     (1.0 - (1.0 / 42.0) * h * (1.0 - (1.0 / 72.0) * h * (1.0 - (1.0 / 110.0) * h * (1.0 - (1.0 / 156.0) * h)))));
  precise float cosine =
      1.0 -
      (1.0 / 2.0) * h *
          (1.0 - (1.0 / 12.0) * h *
                     (1.0 - (1.0 / 30.0) * h * (1.0 - (1.0 / 56.0) * h * (1.0 - (1.0 / 90.0) * h * (1.0 - (1.0 / 132.0) * h)))));
  precise float fullSinc = sinc * cosine;
  precise float fullCosine = 1.0 - 2.0 * h * sinc * sinc;
  // (cos θ − sin θ / θ) / θ²
  precise float slope;
  if (square < 1.0) {
    slope = (-1.0 / 3.0) *
            (1.0 - (1.0 / 10.0) * square *
                       (1.0 - (1.0 / 28.0) * square *
                                  (1.0 - (1.0 / 54.0) * square * (1.0 - (1.0 / 88.0) * square * (1.0 - (1.0 / 130.0) * square)))));
  } else {
    slope = quotient(fullCosine - fullSinc, square);
  }
  precise float along = dot3(screw.real, screw.dual);
  precise vec3 turn = fullSinc * screw.real;
  precise vec3 shift = fullSinc * screw.dual + (slope * along) * screw.real;
  precise float dualScalar = -fullSinc * along;
  real = vec4(turn, fullCosine);
  dual = vec4(shift, dualScalar);
}

#endif
