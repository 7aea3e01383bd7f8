// The bytes of a file of skinned primitives, in each format. Vertices are in the order of the
// accessors, part after part, and are not welded.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "mesh_output.h"

namespace dermis::cli {

/// Binary little-endian PLY: float x y z nx ny nz, then the faces. All parts are one mesh.
std::string plyFile(const OutputMesh& mesh);

/// Wavefront OBJ: one object for each part, with v, vn and, if the part has TEXCOORD_0, vt. The
/// origin of vt is at the bottom left, that of glTF at the top left. Numbers are the shortest that
/// read back as the same float. Names are unique and have no spaces, since some readers end a name
/// at the first space and some merge objects of the same name. There is no material library, since
/// the factors of glTF differ from those of MTL.
std::string objFile(const OutputMesh& mesh);

/// Binary glTF 2.0: for each part a node and a mesh of one primitive, with POSITION, NORMAL,
/// TANGENT, every TEXCOORD_n, COLOR_0, and the factors of its material. A part without triangles
/// becomes points without tangents, so that no vertex is lost. Values that glTF forbids are
/// repaired: normals are normalized (a zero normal becomes 0 0 1). Tangents are normalized (one
/// that is zero or not finite becomes perpendicular to the normal), with a handedness of 1 or -1.
/// Colors and factors are clamped. A texture coordinate that is not finite becomes 0. Positions and
/// normals must be finite. Empty if the file would be larger than 4 GiB.
std::vector<std::byte> glbFile(const OutputMesh& mesh);

}  // namespace dermis::cli
