// The bytes of a file of skinned primitives, format by format. Vertices stand in the order of the
// accessors, part after part, and are not welded.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "mesh_output.h"

namespace dermis::cli {

/// Binary little-endian PLY: float x y z nx ny nz, then the faces. All parts are one mesh.
std::string plyFile(const OutputMesh& mesh);

/// Wavefront OBJ: an object a part, with v, vn and, where the part has TEXCOORD_0, vt, whose origin
/// is at the bottom left where glTF's is at the top left. Numbers are the shortest that read back
/// as the same float. No two objects have the same name, and names have no spaces, for some readers
/// end a name at the first and some make one object of two that are called alike. There is no
/// material library: glTF's factors are not those of MTL.
std::string objFile(const OutputMesh& mesh);

/// Binary glTF 2.0: a node and a mesh of one primitive a part, with POSITION, NORMAL, TANGENT,
/// every TEXCOORD_n, COLOR_0, and the factors of its material. A part without triangles becomes
/// points, so that no vertex is lost, and leaves its tangents out. What glTF forbids is mended: a
/// normal is made as long as 1 (0 0 1 where it is zero), a tangent likewise (square to the normal
/// where it is zero or not finite) with a handedness of 1 or -1, colours and factors are clamped, a
/// texture coordinate that is not finite is 0. Positions and normals must be finite. Empty if
/// the file would be larger than 4 GiB.
std::vector<std::byte> glbFile(const OutputMesh& mesh);

}  // namespace dermis::cli
