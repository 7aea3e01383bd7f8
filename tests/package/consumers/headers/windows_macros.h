// Macros that <windows.h> defines without NOMINMAX and WIN32_LEAN_AND_MEAN, and that Dermis'
// headers must bear.
#pragma once

#define min(a, b) (((a) < (b)) ? (a) : (b))
#define max(a, b) (((a) > (b)) ? (a) : (b))
#define near
#define far
#define small char
#define hyper __int64
#define interface struct
#define IN
#define OUT
#define OPTIONAL
#define CONST const
#define VOID void
#define TRUE 1
#define FALSE 0
#define ERROR 0
#define NO_ERROR 0L
#define IGNORE 0
#define DELETE (0x00010000L)
#define OPAQUE 2
#define TRANSPARENT 1
#define ABSOLUTE 1
#define RELATIVE 2
#define STRICT 1
#define RGB(r, g, b) ((r) | ((g) << 8) | ((b) << 16))
#define GetObject GetObjectW
#define CreateFile CreateFileW
#define LoadImage LoadImageW
#define SendMessage SendMessageW
#define DrawText DrawTextW
#define GetMessage GetMessageW
