// The arm: three joints, to bend at the elbow. It shows how a bend keeps or loses volume.
#include <glm/geometric.hpp>

#include "arm_shape.h"
#include "models.h"
#include "relax.h"
#include "weights.h"

namespace dermis::models {
namespace {

constexpr double cellSize = 0.0068;
constexpr int relaxSteps = 12;
constexpr double bendAngle = 140.0 * degree;
constexpr double bendDuration = 2.0;
constexpr int bendIntervals = 24;
constexpr double elbowZone = 0.060;  // half the length over which the weights go over
constexpr double wristZone = 0.035;

const Vec3 skinColor(0.610, 0.340, 0.230);

// Along x, palm towards the viewer on +z, bending upwards.
const Frame armFrame{{0.0, 0.0, 0.0}, {0.0, 0.0, -1.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}};

Influences influencesAt(const Vec3& position) {
  const double along = armFrame.toLocal(position).y;
  const double forearm = smoothStep(elbowAlong - elbowZone, elbowAlong + elbowZone, along);
  const double hand = smoothStep(wristAlong - wristZone, wristAlong + wristZone, along);
  return quantize({1.0 - forearm, forearm * (1.0 - hand), forearm * hand});
}

Mesh makeMesh() {
  Shape shape;
  for (const Piece& piece : armPieces(armFrame)) shape.add(piece.solid, piece.blend);
  const Field field = [&shape](const Vec3& point) { return shape.distance(point); };
  QuadMesh quads = polygonize(field, gridOver({-0.08, -0.08, -0.08}, {0.78, 0.16, 0.08}, cellSize));
  relax(quads, field, relaxSteps);

  Mesh mesh;
  mesh.indices = triangulate(quads);
  mesh.positions = quads.positions;
  mesh.normals = smoothNormals(mesh.positions, mesh.indices);
  for (const Vec3& position : mesh.positions) {
    mesh.colors.push_back(skinColor);
    mesh.influences.push_back(influencesAt(position));
  }
  return mesh;
}

}  // namespace

Model armModel() {
  Model model;
  model.name = "arm";
  model.roughness = 0.6;
  const Vec3 shoulder = armCenter(armFrame, 0.0);
  const Vec3 elbow = armCenter(armFrame, elbowAlong);
  const Vec3 wrist = armCenter(armFrame, wristAlong);
  const Vec3 knuckles = armCenter(armFrame, knuckleAlong);
  model.skeleton.add("upperArm", noParent, shoulder, elbow - shoulder);
  model.skeleton.add("forearm", 0, elbow, wrist - elbow);
  model.skeleton.add("hand", 1, wrist, knuckles - wrist);
  model.mesh = makeMesh();

  const Vec3 hinge = glm::cross(armFrame.along, armFrame.front);
  model.clips.push_back(sampleCycle("bend", bendDuration, bendIntervals, [&](double phase) {
    const double angle = bendAngle * 0.5 * (1.0 - cosine(2.0 * pi * phase));
    Pose pose(model.skeleton.joints.size());
    pose[1].turn = turn(hinge, angle);
    return pose;
  }));
  return model;
}

std::vector<std::byte> makeArm() {
  return writeGlb(armModel());
}

}  // namespace dermis::models
