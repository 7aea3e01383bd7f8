// Where the programs and files under test are. Defined in one place, so that no object of the tests
// depends on a folder's name.
#pragma once

namespace dermis::test {

extern const char* const sourceFolder;        ///< the repository
extern const char* const sampleModels;        ///< the folder of the sample models
extern const char* const kernelModules;       ///< the folder of the kernels, NAME.spv
extern const char* const kernelSources;       ///< the folder of their GLSL, as it is installed
extern const char* const dermisProgram;       ///< the command
extern const char* const dermisCrowdProgram;  ///< dermis_crowd
extern const char* const
    dermisCrowdFilmProgram;                    ///< dermis_crowd_film; empty where it is not built
extern const char* const dermisViewerProgram;  ///< dermis_viewer; empty where it is not built

}  // namespace dermis::test
