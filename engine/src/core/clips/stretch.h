// How far transforms stretch.
#pragma once

#include "affine.h"

namespace dermis {

/// Bounds of the singular values of a transform that does not mirror. A low bound of 0 or less: it
/// may mirror.
struct Stretch {
  double low = 1, high = 1;

  Stretch operator*(const Stretch& other) const {
    if (low <= 0 || other.low <= 0) return {0, high * other.high};
    return {low * other.low, high * other.high};
  }
};

/// By Gershgorin's theorem for the columns c: the eigenvalues of (cᵢ · cⱼ) are at most as far from
/// cᵢ · cᵢ as Σ |cᵢ · cⱼ|, j ≠ i, for some i.
Stretch stretchOf(const Affine<float>& a);

}  // namespace dermis
