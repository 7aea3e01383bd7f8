// The film's figures and its camera: feet that do not slide, and no flight through a head.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "dermis/clips.h"
#include "dermis/gltf.h"
#include "dermis/verify.h"
#include "gait.h"
#include "kit/program.h"
#include "stroll.h"
#include "test_paths.h"
#include "wardrobe.h"

namespace crowd_film {
namespace {

using dermis::samples::Character;
using dermis::samples::must;

class StrollTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    dermis::Result<Character> loaded =
        Character::load(std::string(dermis::test::sampleModels) + "/figure.glb");
    if (!loaded) return;
    character_ = new Character(std::move(*loaded));
    gait_ = new Gait(measureGait(*character_));
  }
  static void TearDownTestSuite() {
    delete std::exchange(gait_, nullptr);
    delete std::exchange(character_, nullptr);
  }
  void SetUp() override {
    ASSERT_NE(character_, nullptr);
    ASSERT_NE(gait_, nullptr);
  }

  static Character* character_;
  static Gait* gait_;
};

Character* StrollTest::character_ = nullptr;
Gait* StrollTest::gait_ = nullptr;

TEST_F(StrollTest, ReadsTheStrideOffTheSoles) {
  ASSERT_EQ(gait_->clips.size(), 3u);
  const ClipGait& walk = gait_->clips[0];
  ASSERT_TRUE(walk.walks());
  // The generator's stride: 1.36 m in a clip, forwards.
  EXPECT_NEAR(walk.stepZ * character_->tickCount(0), 1.36, 0.01);
  EXPECT_NEAR(walk.stepX * character_->tickCount(0), 0, 0.01);
  EXPECT_NEAR(walk.ground, 0, 0.005);
  EXPECT_FALSE(gait_->clips[1].walks()) << "idle";
  EXPECT_FALSE(gait_->clips[2].walks()) << "wave";
  EXPECT_NEAR(gait_->height, 1.75, 0.1);
}

glm::dvec3 headOf(const dermis::JointMatrix& place, double height) {
  return {place.m[0][3], place.m[1][1] * height, place.m[2][3]};
}

TEST_F(StrollTest, FiguresGoWhereTheirFeetTakeThem) {
  const Stroll stroll(*character_, *gait_, {});
  std::uint32_t walking = 0;
  for (std::uint32_t figure = 0; figure < stroll.count(); ++figure) {
    const ClipGait& gait = gait_->clips[stroll.at(figure, 1).playing.pose.clip];
    const dermis::JointMatrix now = stroll.at(figure, 1).place, next = stroll.at(figure, 2).place;
    const auto& m = now.m;
    const double x = m[0][0] * gait.stepX + m[0][2] * gait.stepZ;
    const double z = m[2][0] * gait.stepX + m[2][2] * gait.stepZ;
    EXPECT_NEAR(next.m[0][3] - m[0][3], x, 0.002) << figure;
    EXPECT_NEAR(next.m[2][3] - m[2][3], z, 0.002) << figure;
    if (gait.walks()) ++walking;
  }
  EXPECT_GT(walking, 800u);
  EXPECT_LT(walking, 1000u);
}

TEST_F(StrollTest, NobodyStandsInTheWayOfAnother) {
  const Stroll stroll(*character_, *gait_, {});
  for (const std::uint64_t frame : {1u, 200u, 700u}) {
    std::vector<dermis::JointMatrix> places;
    for (std::uint32_t figure = 0; figure < stroll.count(); ++figure)
      places.push_back(stroll.at(figure, frame).place);
    for (std::size_t a = 0; a < places.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        const double distance = std::hypot(places[a].m[0][3] - places[b].m[0][3],
                                           places[a].m[2][3] - places[b].m[2][3]);
        ASSERT_GT(distance, 0.6) << "frame " << frame << ", figures " << a << " and " << b;
      }
    }
  }
}

TEST_F(StrollTest, TheCameraComesNearNoHead) {
  for (const std::uint32_t figures : {1u, 30u, 1000u}) {
    StrollOptions options;
    options.figures = figures;
    const Stroll stroll(*character_, *gait_, options);
    const auto frames = static_cast<std::uint64_t>(2 * Flight::seconds * options.framesPerSecond);
    for (std::uint64_t frame = 1; frame <= frames; frame += 2) {
      const Eye eye = stroll.eye(frame);
      for (std::uint32_t figure = 0; figure < figures; ++figure) {
        const glm::dvec3 head = headOf(stroll.at(figure, frame).place, gait_->height);
        const double aside = std::hypot(eye.place[0] - head[0], eye.place[2] - head[2]);
        // Above a head by a hand and more, or beside its body by an arm.
        ASSERT_TRUE(eye.place[1] > head[1] + 0.3 || aside > 0.8)
            << figures << " figures, frame " << frame << ", figure " << figure;
      }
    }
  }
}

TEST_F(StrollTest, TheCameraMovesSmoothly) {
  const Stroll stroll(*character_, *gait_, {});
  const double frameSeconds = 1 / 30.0;
  for (double time = 0; time < Flight::seconds; time += frameSeconds) {
    const glm::dvec3 a = stroll.flight().at(time).place,
                     b = stroll.flight().at(time + frameSeconds).place,
                     c = stroll.flight().at(time + 2 * frameSeconds).place;
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LT(std::abs(b[axis] - a[axis]), 0.5) << time;
      EXPECT_LT(std::abs(c[axis] - 2 * b[axis] + a[axis]), 0.03) << time;
    }
  }
}

/// The largest second difference of a vertex of a figure, in meters, in the frames in which its
/// clips begin anew or fade, and in the others.
class Jerks {
 public:
  Jerks(const Character& character, const dermis::PackedClips& bank)
      : character_(&character), bank_(&bank) {}

  void add(const FigureState& now) {
    std::vector<dermis::ClipLayer> layers;
    character_->addLayers(now.playing, layers);
    std::vector<glm::dvec3> points;
    for (const dermis::samples::Part& part : character_->parts()) {
      std::vector<dermis::JointMatrix> pose(bank_->jointCount(part.skin));
      must(dermis::samplePose(*bank_, layers, part.skin, pose));
      const auto skinned =
          must(dermis::reference::skin(part.primitive.mesh(), pose, dermis::Method::linear));
      for (const auto& position : skinned.positions)
        points.emplace_back(position[0], position[1], position[2]);
    }
    const bool begins = !frames_.empty() && now.playing.pose.tick < last_.playing.pose.tick;
    const bool fades = now.playing.fades() || last_.playing.fades();
    loops += begins ? 1 : 0;
    fadedFrames += fades ? 1 : 0;
    // A second difference has to do with three frames.
    beginsIn_.push_back(begins);
    fadesIn_.push_back(fades);
    frames_.push_back(std::move(points));
    last_ = now;
    if (frames_.size() < 3) return;
    double largest = 0;
    for (std::size_t i = 0; i < frames_[0].size(); ++i) {
      const glm::dvec3 second = frames_[2][i] - 2.0 * frames_[1][i] + frames_[0][i];
      largest = std::max(largest, glm::length(second));
    }
    double& place = fadesIn_[2] || fadesIn_[1]     ? fading
                    : beginsIn_[2] || beginsIn_[1] ? beginning
                                                   : other;
    place = std::max(place, largest);
    frames_.erase(frames_.begin());
    beginsIn_.erase(beginsIn_.begin());
    fadesIn_.erase(fadesIn_.begin());
  }

  double beginning = 0, fading = 0, other = 0;
  std::uint32_t loops = 0, fadedFrames = 0;

 private:
  const Character* character_;
  const dermis::PackedClips* bank_;
  FigureState last_;
  std::vector<std::vector<glm::dvec3>> frames_;
  std::vector<bool> beginsIn_, fadesIn_;
};

/// No clip pops where it begins anew, and no figure where it changes its clip.
TEST_F(StrollTest, FiguresMoveSmoothlyThroughLoopsAndFades) {
  const Stroll stroll(*character_, *gait_, {});
  const dermis::PackedClips bank =
      must(packClips(character_->skeleton(), dermis::gltf::clips(character_->model())));
  std::uint32_t loops = 0, fadedFrames = 0;
  for (const std::uint32_t figure : {0u, 1u, 2u, 3u, 500u}) {
    Jerks jerks(*character_, bank);
    for (std::uint64_t frame = 1; frame <= 300; ++frame) jerks.add(stroll.at(figure, frame));
    std::printf("figure %u: second differences %.2f mm, at loops %.2f mm (%u), in fades %.2f mm\n",
                figure, 1e3 * jerks.other, 1e3 * jerks.beginning, jerks.loops, 1e3 * jerks.fading);
    EXPECT_LE(jerks.beginning, 1.1 * jerks.other);
    EXPECT_LE(jerks.fading, 1.1 * jerks.other);
    loops += jerks.loops;
    fadedFrames += jerks.fadedFrames;
  }
  EXPECT_GT(loops, 10u);
  EXPECT_GT(fadedFrames, 40u);
}

TEST_F(StrollTest, WhoIsFarAwayIsUpdatedLessOften) {
  const Stroll stroll(*character_, *gait_, {});
  const Eye eye = stroll.eye(1);
  std::map<std::uint32_t, double> farthest;
  for (std::uint32_t figure = 0; figure < stroll.count(); ++figure) {
    const FigureState now = stroll.at(figure, 1);
    if (!now.isInView) continue;
    const glm::dvec3 middle = headOf(now.place, gait_->height / 2);
    farthest[now.updateInterval] =
        std::max(farthest[now.updateInterval], glm::distance(middle, eye.place));
  }
  ASSERT_GE(farthest.size(), 2u);
  double before = 0;
  for (const auto& [interval, distance] : farthest) {
    EXPECT_GT(distance, before) << interval;
    before = distance;
  }
}

TEST_F(StrollTest, FiguresWearColorsOfTheirOwn) {
  const Wardrobe wardrobe(*character_);
  for (std::uint32_t part = 0; part < character_->parts().size(); ++part) {
    std::set<std::array<float, 3>> tints;
    for (std::uint32_t figure = 0; figure < 100; ++figure) {
      const glm::vec3 tint = wardrobe.tint(figure, part);
      tints.insert({tint.r, tint.g, tint.b});
    }
    EXPECT_GT(tints.size(), 20u) << part;
  }
}

}  // namespace
}  // namespace crowd_film
