// The functions of glTF in a build without it: there is never a model.
#include "object.h"

namespace {

dermis_code missing(dermis_error* error) {
  return dermis::c::report(error, DERMIS_MISSING_FEATURE,
                           "this library was built without glTF (DERMIS_BUILD_GLTF)");
}

}  // namespace

extern "C" {

dermis_code dermis_model_load(const dermis_model_source*, dermis_model**, dermis_error* error) {
  return missing(error);
}
dermis_code dermis_model_apply_rig(dermis_model*, uint32_t, const char*, dermis_packed_rig**,
                                   dermis_error* error) {
  return missing(error);
}
dermis_code dermis_model_contents(const dermis_model*, dermis_model_info*, dermis_error* error) {
  return missing(error);
}
dermis_code dermis_model_primitive(const dermis_model*, uint32_t, dermis_primitive*,
                                   dermis_error* error) {
  return missing(error);
}
dermis_code dermis_model_clips(const dermis_model*, dermis_clips_source*, dermis_error* error) {
  return missing(error);
}
dermis_code dermis_model_pose(const dermis_model*, uint32_t, uint32_t, double, dermis_joint*,
                              uint32_t, float*, uint32_t, dermis_error* error) {
  return missing(error);
}

}  // extern "C"
