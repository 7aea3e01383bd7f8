// The only translation unit with tinygltf's code. With TINYGLTF_NO_FS, tinygltf does not include
// <fstream>, but its writer needs it.
#include <fstream>

#define TINYGLTF_IMPLEMENTATION
#include "gltf/tinygltf.h"
