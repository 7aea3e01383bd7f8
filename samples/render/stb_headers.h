// stb as the renderer uses it: declarations here, its code in stb_implementation.cpp.
#pragma once

// The switches change what is compiled: PNG and JPEG from memory are all that glTF needs.
#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STBI_WRITE_NO_STDIO

// Before stb_truetype.h, which otherwise declares rectangles of its own: Dear ImGui, in a program
// that has both, calls these functions with those of stb_rect_pack.h.
#include <stb/stb_rect_pack.h>

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>
#include <stb/stb_truetype.h>
