#include "test_paths.h"

namespace dermis::test {

const char* const sourceFolder = DERMIS_SOURCE_DIR;
const char* const sampleModels = DERMIS_SAMPLE_MODELS;
const char* const kernelModules = DERMIS_KERNELS;
const char* const kernelSources = DERMIS_KERNEL_SOURCES;
const char* const dermisProgram = DERMIS_COMMAND;
const char* const dermisCrowdProgram = DERMIS_CROWD;
const char* const dermisCrowdFilmProgram = DERMIS_CROWD_FILM;
const char* const dermisViewerProgram = DERMIS_VIEWER;

}  // namespace dermis::test
