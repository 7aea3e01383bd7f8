// tinygltf as Dermis uses it: a parser of JSON into structs, with no image loaders and no access to
// files. Everything in Dermis that includes tiny_gltf.h does so through here, because the switches
// change the classes.
#pragma once

// An engine may have a tinygltf of its own, built with other switches: in this namespace the two
// cannot be mixed up by the linker.
#define tinygltf dermis_tinygltf
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#define TINYGLTF_NO_INCLUDE_JSON
#define TINYGLTF_USE_CPP14

#include <nlohmann/json.hpp>

#include <tiny_gltf.h>
