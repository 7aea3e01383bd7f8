#version 450

// Writes the poses of all figures, one after the other, with two joints each. A joint is three rows of a 3x4 matrix: joint global
// transform times inverse bind matrix. Joint 0 does not move; joint 1 turns about the figure's axis, by a different angle for each
// figure.

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
  uint figureCount;
  float time;
};

struct Joint {
  vec4 rows[3];
};
layout(set = 0, binding = 0, std430) writeonly buffer Poses { Joint joints[]; };

void main() {
  uint figure = gl_GlobalInvocationID.x;
  if (figure >= figureCount) return;
  float angle = 1.5 * sin(time + 0.01 * float(figure));
  joints[figure * 2u] = Joint(vec4[](vec4(1, 0, 0, 0), vec4(0, 1, 0, 0), vec4(0, 0, 1, 0)));
  joints[figure * 2u + 1u] =
      Joint(vec4[](vec4(cos(angle), 0, sin(angle), 0), vec4(0, 1, 0, 0), vec4(-sin(angle), 0, cos(angle), 0)));
}
