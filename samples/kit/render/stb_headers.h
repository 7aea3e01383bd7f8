// stb for the renderer: declarations here, code in stb_implementation.cpp.
#pragma once

// The macros limit what is compiled: glTF needs only PNG and JPEG from memory.
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_WRITE_NO_STDIO

// Must come before stb_truetype.h, which otherwise declares its own rectangles. If a program also
// contains Dear ImGui, its calls of these functions use those of stb_rect_pack.h.
#include <stb/stb_rect_pack.h>

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stb/stb_truetype.h>
