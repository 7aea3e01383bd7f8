// The version of Dermis. CMake reads it from here.
#pragma once

#define DERMIS_VERSION_MAJOR 0
#define DERMIS_VERSION_MINOR 1
#define DERMIS_VERSION_PATCH 0
