// The film's figures and its camera: feet that do not slide, heads that nobody flies through, and
// triangles that leave no gap.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coarse_triangles.h"
#include "gait.h"
#include "stroll.h"
#include "test_paths.h"
#include "wardrobe.h"

namespace crowd {
namespace {

class StrollTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    dermis::Result<Character> loaded =
        Character::load(std::string(dermis::test::sampleModels) + "/figure.glb");
    if (!loaded) return;
    character_ = new Character(std::move(*loaded));
    dermis::Result<Gait> gait = measureGait(*character_);
    if (gait) gait_ = new Gait(std::move(*gait));
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

std::array<double, 3> headOf(const dermis::JointMatrix& place, double height) {
  return {place.m[0][3], place.m[1][1] * height, place.m[2][3]};
}

TEST_F(StrollTest, FiguresGoWhereTheirFeetTakeThem) {
  const Stroll stroll(*character_, *gait_, {});
  std::uint32_t walking = 0;
  for (std::uint32_t figure = 0; figure < stroll.count(); ++figure) {
    const ClipGait& gait = gait_->clips[stroll.at(figure, 1).pose.clip];
    const dermis::JointMatrix now = stroll.place(figure, 1), next = stroll.place(figure, 2);
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
      places.push_back(stroll.place(figure, frame));
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
        const std::array<double, 3> head = headOf(stroll.place(figure, frame), gait_->height);
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
    const std::array<double, 3> a = stroll.flight().at(time).place,
                                b = stroll.flight().at(time + frameSeconds).place,
                                c = stroll.flight().at(time + 2 * frameSeconds).place;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_LT(std::abs(b[axis] - a[axis]), 0.5) << time;
      EXPECT_LT(std::abs(c[axis] - 2 * b[axis] + a[axis]), 0.03) << time;
    }
  }
}

TEST_F(StrollTest, WhoIsFarAwayIsUpdatedLessOften) {
  const Stroll stroll(*character_, *gait_, {});
  const Eye eye = stroll.eye(1);
  std::map<std::uint32_t, double> farthest;
  for (std::uint32_t figure = 0; figure < stroll.count(); ++figure) {
    const FigureFrame now = stroll.at(figure, 1);
    if (!now.isInView) continue;
    const std::array<double, 3> head = headOf(stroll.place(figure, 1), gait_->height / 2);
    const double distance =
        std::hypot(head[0] - eye.place[0], head[1] - eye.place[1], head[2] - eye.place[2]);
    farthest[now.updateInterval] = std::max(farthest[now.updateInterval], distance);
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
    for (std::uint32_t figure = 0; figure < 100; ++figure)
      tints.insert(wardrobe.tint(figure, part));
    EXPECT_GT(tints.size(), 20u) << part;
  }
}

using Point = std::array<float, 3>;
using Edge = std::pair<Point, Point>;

/// Edges that have a triangle on one side only. Vertices at one point count as one.
std::size_t openEdges(const Character& character,
                      const std::vector<std::vector<std::uint32_t>>& triangles) {
  std::map<Edge, int> sides;
  for (std::size_t part = 0; part < triangles.size(); ++part) {
    const std::vector<float>& positions = character.parts()[part].source->positions;
    const auto point = [&](std::uint32_t vertex) {
      return Point{positions[vertex * 3], positions[vertex * 3 + 1], positions[vertex * 3 + 2]};
    };
    for (std::size_t i = 0; i < triangles[part].size(); ++i) {
      const std::size_t first = i / 3 * 3;
      const Point a = point(triangles[part][i]), b = point(triangles[part][first + (i + 1) % 3]);
      sides[{a, b}] += 1;
      sides[{b, a}] -= 1;
    }
  }
  return static_cast<std::size_t>(
      std::ranges::count_if(sides, [](const auto& side) { return side.second > 0; }));
}

TEST_F(StrollTest, CoarseTrianglesLeaveNoGap) {
  std::vector<std::vector<std::uint32_t>> fine;
  std::size_t fineCount = 0;
  for (const Part& part : character_->parts()) {
    fine.push_back(part.source->triangles);
    fineCount += fine.back().size();
  }
  ASSERT_EQ(openEdges(*character_, fine), 0u) << "the figure is closed";
  for (const double cell : {0.009, 0.016, 0.03}) {
    const auto coarse = coarseTriangles(character_->parts(), cell);
    std::size_t count = 0;
    for (const auto& part : coarse) count += part.size();
    EXPECT_LT(count, fineCount * 3 / 4) << cell;
    EXPECT_GT(count, fineCount / 50) << cell;
    EXPECT_EQ(openEdges(*character_, coarse), 0u) << cell;
  }
}

}  // namespace
}  // namespace crowd
