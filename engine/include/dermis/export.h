// Export macros of the shared libraries, one for each library. If DERMIS_SHARED is defined, a
// declaration with the macro is exported while that library is compiled, and imported elsewhere;
// everything else is hidden. The CMake targets and dermis.pc of a shared build define
// DERMIS_SHARED. In a static build the macros are empty, so a plugin that links Dermis exports
// nothing of it.
#pragma once

#if !defined(DERMIS_SHARED)
#define DERMIS_EXPORTED
#define DERMIS_IMPORTED
#elif defined(_WIN32)
#define DERMIS_EXPORTED __declspec(dllexport)
#define DERMIS_IMPORTED __declspec(dllimport)
#else
#define DERMIS_EXPORTED __attribute__((visibility("default")))
#define DERMIS_IMPORTED __attribute__((visibility("default")))
#endif

// DERMIS_BUILDS_... is defined while the sources of that library are compiled.
#if defined(DERMIS_BUILDS_CORE)
#define DERMIS_CORE_API DERMIS_EXPORTED
#else
#define DERMIS_CORE_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_CPU)
#define DERMIS_CPU_API DERMIS_EXPORTED
#else
#define DERMIS_CPU_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_VERIFY)
#define DERMIS_VERIFY_API DERMIS_EXPORTED
#else
#define DERMIS_VERIFY_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_VULKAN)
#define DERMIS_VULKAN_API DERMIS_EXPORTED
#else
#define DERMIS_VULKAN_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_SHADER_COMPILER)
#define DERMIS_SHADER_COMPILER_API DERMIS_EXPORTED
#else
#define DERMIS_SHADER_COMPILER_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_RUNTIME_COMPILER)
#define DERMIS_RUNTIME_COMPILER_API DERMIS_EXPORTED
#else
#define DERMIS_RUNTIME_COMPILER_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_GLTF)
#define DERMIS_GLTF_API DERMIS_EXPORTED
#else
#define DERMIS_GLTF_API DERMIS_IMPORTED
#endif
