// The one translation unit that holds tinygltf's code.
// Without TINYGLTF_NO_FS it would include this itself; its writer needs it all the same.
#include <fstream>

#define TINYGLTF_IMPLEMENTATION
#include "gltf/tinygltf.h"
