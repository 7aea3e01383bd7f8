// How many bytes banks of clips take for their error, beside ozz-animation where it was built with
// -DDERMIS_BENCH_OZZ=FOLDER. Both are measured in the same way, against the source clips in double
// precision: how far a point is from where it should be that is as far from a joint of skin 0 as
// the joint's farthest child is, or its parent, along each axis. Each clip is sampled alone, at 97
// times. The skeleton is not counted. Clips with jumps or splines are left out, since ozz-animation
// has none.
//
//   dermis_clips_size_benchmark MODEL...    prints tables
//   dermis_clips_size_benchmark --tsv MODEL...    prints rows: model, who, bytes, error / extent

#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "clips_subject.h"
#include "dermis/verify.h"

namespace {

using namespace dermis;
using namespace dermis::bench;

using PoseOf = std::function<std::vector<JointMatrix>(std::uint32_t clip, double seconds)>;

constexpr int times = 97;

class Measure {
 public:
  explicit Measure(const Subject& subject) : subject_(subject) {
    const SkeletonSkin& skin = subject.skeleton.skins[0];
    const auto& nodes = subject.skeleton.nodes;
    const auto lengthOf = [&](std::size_t node) {
      const auto& t = nodes[node].translation;
      return std::hypot(t[0], t[1], t[2]);
    };
    for (std::size_t joint = 0; joint < skin.joints.size(); ++joint) {
      double reach = 0;
      for (std::size_t node = 0; node < nodes.size(); ++node) {
        if (nodes[node].parent == skin.joints[joint]) reach = std::max(reach, lengthOf(node));
      }
      reach_.push_back(reach > 0 ? reach : lengthOf(skin.joints[joint]));
      bind_.push_back(inverse(skin.inverseBind[joint]));
    }
    std::array<std::array<double, 2>, 3> box{};
    for (std::size_t joint = 0; joint < bind_.size(); ++joint) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double x = bind_[joint][axis][3];
        box[axis][0] = joint == 0 ? x : std::min(box[axis][0], x);
        box[axis][1] = joint == 0 ? x : std::max(box[axis][1], x);
        extent = std::max(extent, box[axis][1] - box[axis][0]);
      }
    }
    for (std::uint32_t clip = 0; clip < subject.clips.size(); ++clip) {
      for (int i = 0; i < times; ++i) {
        const double time = subject.clips[clip].duration * i / times;
        const ClipLayer layer{.clip = clip, .time = time};
        exact_.push_back(
            must(reference::samplePose(subject.skeleton, subject.clips, {}, {&layer, 1}, 0))
                .joints);
      }
    }
  }

  /// The largest error.
  double operator()(const PoseOf& poseOf) const {
    double worst = 0;
    for (std::uint32_t clip = 0; clip < subject_.clips.size(); ++clip) {
      for (int i = 0; i < times; ++i) {
        const std::vector<JointMatrix> pose =
            poseOf(clip, subject_.clips[clip].duration * i / times);
        const std::vector<Transform>& exact =
            exact_[clip * std::size_t{times} + static_cast<std::size_t>(i)];
        for (std::size_t joint = 0; joint < pose.size(); ++joint)
          worst = std::max(worst, apart(pose[joint], exact[joint], joint));
      }
    }
    return worst;
  }

  double extent = 0;  ///< of the joints in bind pose

 private:
  static Affine<double> inverse(const JointMatrix& matrix) {
    const auto& m = matrix.m;
    const auto minor = [&](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
      return double{m[a][b]} * double{m[c][d]} - double{m[a][d]} * double{m[c][b]};
    };
    Affine<double> result{};
    double determinant = 0;
    for (std::size_t i = 0; i < 3; ++i)
      determinant += double{m[0][i]} * minor(1, (i + 1) % 3, 2, (i + 2) % 3);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j)
        result[i][j] = minor((j + 1) % 3, (i + 1) % 3, (j + 2) % 3, (i + 2) % 3) / determinant;
      for (std::size_t j = 0; j < 3; ++j) result[i][3] -= result[i][j] * double{m[j][3]};
    }
    return result;
  }

  double apart(const JointMatrix& matrix, const Transform& exact, std::size_t joint) const {
    Affine<double> difference;
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t i = 0; i < 4; ++i)
        difference[row][i] = double{matrix.m[row][i]} - exact[row][i];
    }
    // In bind space, then in that of the joint.
    Affine<double> local = multiply(difference, bind_[joint]);
    double worst = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const double side : {-1.0, 1.0}) {
        double square = 0;
        for (std::size_t row = 0; row < 3; ++row) {
          const double x = local[row][3] + side * reach_[joint] * local[row][axis];
          square += x * x;
        }
        worst = std::max(worst, std::sqrt(square));
      }
    }
    return worst;
  }

  const Subject& subject_;
  std::vector<double> reach_;  ///< of each joint
  std::vector<Affine<double>> bind_;
  std::vector<std::vector<Transform>> exact_;  ///< of each clip and time
};

bool isComparable(const ClipView& clip) {
  return clip.duration > 0 && std::ranges::all_of(clip.channels, [](const ChannelView& channel) {
           bool ascends = true;
           for (std::size_t i = 1; i < channel.times.size(); ++i)
             ascends = ascends && channel.times[i] > channel.times[i - 1];
           return ascends && channel.interpolation == Interpolation::linear;
         });
}

struct Size {
  std::size_t bytes;  ///< of clips, without the skeleton
  double error;
};

/// What a bank has besides its clips: nodes, skins, and matrices that are folded in.
std::size_t skeletonBytes(const PackedClips& packed) {
  const ClipBank bank(packed);
  std::size_t bytes = sizeof(BankHeader) + bank.header.nodeCount * sizeof(BankNode);
  for (std::size_t i = 0; i < bank.header.nodeCount; ++i)
    bytes += bank.node(i).fixed != 0 ? sizeof(Affine<float>) : 0;
  for (std::uint32_t skin = 0; skin < packed.skinCount(); ++skin)
    bytes += sizeof(BankSkin) + packed.jointCount(skin) * (4 + sizeof(Affine<float>));
  return bytes;
}

Size dermisSize(const Subject& subject, const Measure& measure, double maxError) {
  PackClipsOptions options;
  options.maxError = maxError;
  const Result<PackedClips> packed = packClips(subject.skeleton, subject.clips, options);
  if (!packed) return {0, std::numeric_limits<double>::infinity()};  // it cannot be kept
  const PackedClips& bank = *packed;
  const double error = measure([&](std::uint32_t clip, double seconds) {
    std::vector<JointMatrix> pose(bank.jointCount(0));
    const ClipLayer layer{.clip = clip, .time = seconds};
    const Result<void> sampled = samplePose(bank, {&layer, 1}, 0, pose);
    if (!sampled) fail(sampled.error().message);
    return pose;
  });
  return {bank.bytes().size() - skeletonBytes(bank), error};
}

#ifdef DERMIS_BENCH_OZZ
/// The bank whose error is just below one.
Size dermisSizeAt(const Subject& subject, const Measure& measure, double error) {
  double low = error / 8, high = error * 8;
  Size best = dermisSize(subject, measure, low);
  for (int i = 0; i < 6; ++i) {
    const double middle = std::sqrt(low * high);
    const Size size = dermisSize(subject, measure, middle);
    if (size.error <= error) best = size;
    (size.error <= error ? low : high) = middle;
  }
  return best;
}
#endif

}  // namespace

int main(int argc, char** argv) {
  const bool tsv = argc > 1 && std::strcmp(argv[1], "--tsv") == 0;
  if (argc < 2 + tsv) fail("usage: dermis_clips_size_benchmark [--tsv] MODEL...");
  for (int i = 1 + tsv; i < argc; ++i) {
    Subject subject(argv[i], 0);
    std::erase_if(subject.clips, [](const ClipView& clip) { return !isComparable(clip); });
    const std::string name = std::filesystem::path(argv[i]).stem().string();
    if (subject.clips.empty()) {
      std::printf("%s: no clip without jumps and splines\n", name.c_str());
      continue;
    }
    subject.bank = must(packClips(subject.skeleton, subject.clips));
    const Measure measure(subject);
    std::size_t source = 0;
    for (const ClipView& clip : subject.clips) {
      for (const ChannelView& channel : clip.channels)
        source += channel.times.size_bytes() + channel.values.size_bytes();
    }
    if (!tsv) {
      std::printf("%s: %zu clips, %zu joints, extent %g, %zu bytes of keys in the file\n",
                  name.c_str(), subject.clips.size(), subject.skeleton.skins[0].joints.size(),
                  measure.extent, source);
      std::printf("  %-28s %10s %12s %14s\n", "", "bytes", "error", "error/extent");
    }
    const auto print = [&](const std::string& who, const Size& size) {
      if (size.bytes == 0) {
        if (!tsv) std::printf("  %-28s is refused: clips turn too fast\n", who.c_str());
        return;
      }
      if (tsv) {
        std::printf("%s\t%s\t%zu\t%g\n", name.c_str(), who.substr(0, who.find(',')).c_str(),
                    size.bytes, size.error / measure.extent);
      } else {
        std::printf("  %-28s %10zu %12.3g %14.3g\n", who.c_str(), size.bytes, size.error,
                    size.error / measure.extent);
      }
      std::fflush(stdout);
    };
    for (const double share : {5e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5}) {
      char who[64];
      std::snprintf(who, sizeof(who), "Dermis, extent x %g", share);
      print(who, dermisSize(subject, measure, share * measure.extent));
    }
#ifdef DERMIS_BENCH_OZZ
    if (!Ozz(subject).isComparable()) {
      if (!tsv) std::printf("  ozz-animation: nodes that do not move lie between others\n");
      continue;
    }
    for (const double tolerance : {1e-2, 1e-3, 3e-4, 1e-4, 3e-5}) {
      const Ozz ozz(subject, static_cast<float>(tolerance));
      const Size size{ozz.bytes(), measure([&](std::uint32_t clip, double seconds) {
                        return ozz.pose(clip, seconds);
                      })};
      char who[64];
      std::snprintf(who, sizeof(who), "ozz-animation, %g m", tolerance);
      print(who, size);
      if (tolerance != 1e-3 || tsv) continue;
      const Size own = dermisSizeAt(subject, measure, size.error);
      print("Dermis, at that error", own);
      std::printf("  Dermis / ozz-animation: %.2f\n",
                  static_cast<double>(own.bytes) / static_cast<double>(size.bytes));
    }
#endif
  }
  return 0;
}
