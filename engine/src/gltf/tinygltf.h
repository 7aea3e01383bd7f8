// tinygltf as Dermis uses it: it parses JSON into structs, without image loaders or access to
// files. All of Dermis includes tiny_gltf.h through this header, because the switches change the
// classes.
#pragma once

// An engine may have its own tinygltf, built with other switches. The linker cannot confuse the
// two, because this one is in another namespace.
#define tinygltf dermis_tinygltf
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#define TINYGLTF_NO_INCLUDE_JSON
#define TINYGLTF_USE_CPP14

#include <nlohmann/json.hpp>

#include <tiny_gltf.h>
