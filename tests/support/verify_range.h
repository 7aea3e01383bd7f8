// The edges of the range of the accuracy contract (docs/accuracy.md), and poses of all sizes, on
// one target.
#pragma once

#include "kit/batch_runner.h"

namespace dermis::test {

/// Mirrored joints whose determinant is just inside the range, just outside of it, and 0.
void verifyThinMirrors(samples::BatchTarget& target);
/// Joints just inside the lower end of the range, and down to the least denormals.
void verifyTinyJoints(samples::BatchTarget& target);
/// Translations, scales, positions and directions on both sides of the upper end. What exceeds it
/// must not affect the other vertices.
void verifyLargeNumbers(samples::BatchTarget& target);
/// Joints with entries of every size, from 2^-120 to 2^120.
void verifyEntriesOfAnySize(samples::BatchTarget& target);
/// Poses that mix joints of many awkward kinds: mirrored, flat, tiny, huge, not finite. `repeats`
/// for each kind.
void verifyHostilePoses(samples::BatchTarget& target, std::uint32_t influences, int repeats);

}  // namespace dermis::test
