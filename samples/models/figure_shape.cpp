// The body's surface: lofts for trunk and limbs, ellipsoids for what stands out of them.
#include <glm/geometric.hpp>

#include "arm_shape.h"
#include "figure.h"
#include "relax.h"

namespace dermis::models {
namespace {

constexpr double cellSize = 0.0176;
constexpr int relaxSteps = 3;

const Frame upright{{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};

void addTrunk(Shape& shape) {
  shape.add(loft(upright,
                 {{0.800, 0.0, -0.006, 0.060, 0.050, 0.060},
                  {0.845, 0.0, -0.006, 0.125, 0.082, 0.095},
                  {0.900, 0.0, -0.008, 0.164, 0.098, 0.108},
                  {0.950, 0.0, -0.008, 0.166, 0.104, 0.110},
                  {1.000, 0.0, -0.007, 0.156, 0.105, 0.100},
                  {1.060, 0.0, -0.006, 0.141, 0.102, 0.088},
                  {1.120, 0.0, -0.006, 0.135, 0.101, 0.084},
                  {1.190, 0.0, -0.008, 0.143, 0.107, 0.094},
                  {1.270, 0.0, -0.014, 0.157, 0.120, 0.106},
                  {1.340, 0.0, -0.021, 0.166, 0.120, 0.108},
                  {1.400, 0.0, -0.029, 0.157, 0.100, 0.094},
                  {1.445, 0.0, -0.036, 0.118, 0.074, 0.076},
                  {1.480, 0.0, -0.040, 0.075, 0.057, 0.062}},
                 0.03),
            0.0);
  // Buttocks, breast muscles, shoulder blades.
  shape.addPair(ellipsoid({0.074, 0.892, -0.070}, {0.080, 0.088, 0.058}), 0.06);
  shape.addPair(ellipsoid({0.072, 1.335, 0.050}, {0.082, 0.056, 0.042}), 0.07);
  shape.addPair(ellipsoid({0.078, 1.345, -0.088}, {0.074, 0.110, 0.036}), 0.08);
  // The slope from neck to shoulder.
  shape.addPair(roundCone({0.035, 1.480, -0.048}, {0.155, 1.440, -0.034}, 0.040, 0.042), 0.05);
}

void addHead(Shape& shape) {
  shape.add(loft(upright,
                 {{1.440, 0.0, -0.042, 0.060, 0.056, 0.058},
                  {1.490, 0.0, -0.036, 0.055, 0.052, 0.056},
                  {1.540, 0.0, -0.024, 0.053, 0.050, 0.054},
                  {1.600, 0.0, -0.012, 0.054, 0.050, 0.056}},
                 0.03),
            0.04);
  shape.add(ellipsoid({0.0, 1.654, -0.008}, {0.0745, 0.095, 0.096}), 0.02);  // skull
  shape.add(ellipsoid({0.0, 1.661, -0.014}, {0.0780, 0.089, 0.095}), 0.02);  // hair
  shape.add(ellipsoid({0.0, 1.598, 0.034}, {0.0570, 0.078, 0.063}), 0.040);  // face
  shape.addPair(roundCone({0.050, 1.588, 0.005}, {0.014, 1.538, 0.074}, 0.018, 0.018),
                0.035);                                                           // jaw
  shape.addPair(ellipsoid({0.036, 1.610, 0.062}, {0.024, 0.020, 0.021}), 0.035);  // cheeks
  shape.addPair(roundCone({0.012, 1.664, 0.080}, {0.044, 1.662, 0.062}, 0.008, 0.008),
                0.030);                                                                 // brow
  shape.add(roundCone({0.0, 1.650, 0.088}, {0.0, 1.614, 0.107}, 0.007, 0.010), 0.018);  // nose
  shape.addPair(sphere({0.008, 1.611, 0.100}, 0.008), 0.008);
  shape.add(ellipsoid({0.0, 1.579, 0.089}, {0.022, 0.007, 0.010}), 0.010);  // lips
  shape.add(ellipsoid({0.0, 1.568, 0.087}, {0.019, 0.007, 0.010}), 0.010);
  shape.addPair(ellipsoid({0.0765, 1.624, -0.010}, {0.010, 0.032, 0.019}), 0.010);  // ears
}

Solid leftLeg() {
  return loft(upright,
              {{0.060, 0.107, -0.020, 0.034, 0.040, 0.036},
               {0.110, 0.107, -0.020, 0.035, 0.039, 0.037},
               {0.160, 0.106, -0.018, 0.038, 0.040, 0.041},
               {0.230, 0.105, -0.015, 0.045, 0.043, 0.051},
               {0.320, 0.104, -0.010, 0.053, 0.048, 0.064},
               {0.380, 0.103, -0.004, 0.055, 0.051, 0.063},
               {0.450, 0.101, 0.004, 0.052, 0.055, 0.054},
               {0.490, 0.101, 0.007, 0.054, 0.060, 0.053},
               {0.540, 0.100, 0.008, 0.058, 0.061, 0.057},
               {0.620, 0.099, 0.006, 0.067, 0.070, 0.067},
               {0.700, 0.097, 0.003, 0.075, 0.079, 0.077},
               {0.780, 0.094, 0.000, 0.081, 0.085, 0.085},
               {0.850, 0.091, -0.002, 0.083, 0.086, 0.088},
               {0.930, 0.088, -0.004, 0.076, 0.078, 0.080}},
              0.04);
}

void addLeftFoot(Shape& shape) {
  // Sections reach below the ground, which then cuts them: that makes the sole flat.
  shape.add(loft(leftFootFrame(),
                 {{-0.072, 0.000, 0.034, 0.027, 0.030, 0.050},
                  {-0.040, 0.000, 0.036, 0.034, 0.046, 0.060},
                  {0.000, 0.001, 0.036, 0.036, 0.052, 0.060},
                  {0.050, 0.002, 0.034, 0.040, 0.044, 0.060},
                  {0.100, 0.004, 0.030, 0.047, 0.033, 0.060},
                  {0.140, 0.003, 0.026, 0.047, 0.026, 0.055},
                  {0.175, -0.003, 0.023, 0.038, 0.021, 0.050},
                  {0.192, -0.006, 0.021, 0.028, 0.017, 0.045}},
                 0.03),
            0.03);
}

// Half of all cells would be wasted on the trunk if hands were to have enough of them everywhere.
// So the grid lies in a space where hands, feet and head are larger, and what it finds is shrunk
// back.
struct Lens {
  Vec3 center;
  double radius;
  double strength;  // at the center, lengths are shrunk by 1 − strength
};

Vec3 throughLenses(Vec3 point, const std::vector<Lens>& lenses) {
  for (const Lens& lens : lenses) {
    const Vec3 offset = point - lens.center;
    const double ratio = glm::dot(offset, offset) / (lens.radius * lens.radius);
    if (ratio >= 1.0) continue;
    const double rest = 1.0 - ratio;
    const double fade = rest * rest * rest;
    point = lens.center + offset * (1.0 - lens.strength * fade);
  }
  return point;
}

std::vector<Lens> lenses() {
  const Vec3 hand = armCenter(leftArmFrame(), 0.645);
  const Vec3 foot = leftFootFrame().toModel({0.0, 0.05, 0.03});
  std::vector<Lens> list = {{{0.0, 1.612, 0.050}, 0.290, 0.62}};
  for (const double side : {1.0, -1.0}) {
    list.push_back({{hand.x * side, hand.y, hand.z}, 0.310, 0.76});
    list.push_back({{foot.x * side, foot.y, foot.z}, 0.240, 0.40});
  }
  return list;
}

}  // namespace

Frame leftArmFrame() {
  const double angle = 44.0 * degree;
  const double s = sine(angle);
  const double c = cosine(angle);
  return {shoulderPoint, {c, s, 0.0}, {s, -c, 0.0}, {0.0, 0.0, 1.0}};
}

Frame leftFootFrame() {
  const double s = sine(toeOut);
  const double c = cosine(toeOut);
  return {{anklePoint.x, 0.0, anklePoint.z}, {c, 0.0, -s}, {s, 0.0, c}, {0.0, 1.0, 0.0}};
}

FigureShape figureShape() {
  FigureShape shape;
  addTrunk(shape.trunk);
  addHead(shape.trunk);
  for (const Piece& piece : armPieces(leftArmFrame())) shape.leftArm.add(piece.solid, piece.blend);

  addTrunk(shape.whole);
  shape.whole.addPair(leftLeg(), 0.055);
  Shape foot;
  addLeftFoot(foot);
  const Vec3 middleOfFoot = leftFootFrame().toModel({0.0, 0.06, 0.03});
  shape.whole.addPair(
      {[foot](const Vec3& point) { return foot.distance(point); }, {middleOfFoot, 0.17}}, 0.03);
  for (const Piece& piece : armPieces(leftArmFrame())) {
    shape.whole.addPair(piece.solid, piece.blend);
  }
  addHead(shape.whole);
  // Below the ground.
  const Solid ground{[](const Vec3& point) { return point.y; }, {{0.0, -10.0, 0.0}, 10.4}};
  shape.whole.carve(ground, 0.020);
  return shape;
}

FigureSurface figureSurface(const FigureShape& shape) {
  const std::vector<Lens> list = lenses();
  const Field seen = [&](const Vec3& point) {
    return shape.whole.distance(throughLenses(point, list));
  };
  QuadMesh quads =
      polygonize(seen, gridOver({-0.855, -0.06, -0.27}, {0.855, 1.86, 0.27}, cellSize));
  relax(quads, seen, relaxSteps);

  const Field field = [&](const Vec3& point) { return shape.whole.distance(point); };
  FigureSurface surface;
  for (Vec3& position : quads.positions) position = throughLenses(position, list);
  snapToBorders(quads.positions, triangulate(quads), figureRegions(shape), field);
  surface.indices = triangulate(quads);
  surface.positions = std::move(quads.positions);
  surface.normals = smoothNormals(surface.positions, surface.indices);
  return surface;
}

}  // namespace dermis::models
