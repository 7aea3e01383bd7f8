#include "object.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>

namespace dermis::c {
namespace {

/// What messages of C++ name, and its name in C. Longer names come before those that they contain.
constexpr std::pair<std::string_view, std::string_view> names[] = {
    {"SceneRecorder::prepare", "dermis_prepare"},
    {"Context::prepare", "dermis_prepare"},
    {"SceneRecorder::requirement", "dermis_recorder_requirement"},
    {"Context::limits()", "the limits of dermis_context_create"},
    {"DeviceDescription::apiVersion", "api_version"},
    {"Batch::isOneOutput", "has_separate_outputs"},
    {"MeshView::influenceSets", "influence_sets"},
    {"influenceSets", "influence_sets"},
    {"makePlan", "dermis_make_plan"},
    {"beginFrame", "dermis_begin_frame"},
    {"abandonFrame", "dermis_abandon_frame"},
    {"writePose", "dermis_write_poses"},
    {"markWritten", "dermis_mark_written"},
    {"repair()", "dermis_repair"},
    {"packRig", "dermis_pack_rig"},
    {"evaluateRig", "dermis_evaluate_rig"},
    {"bendChain", "dermis_bend_chain"},
    {"framesInFlight", "frames_in_flight"},
    {"gpuJointCapacity", "gpu_joints"},
    {"jointCapacity", "joints"},
    {"meshCapacity", "mesh_bytes"},
    {"outputCapacity", "output_bytes"},
    {"instanceCapacity", "instances"},
    {"boundsCapacity", "bounds"},
    {"getInstanceProcAddr", "get_instance_proc_addr"},
    {"physicalDevice", "physical_device"}};

/// A message in the words of C. Names of the caller are in quotes and stay.
std::string inWordsOfC(std::string message) {
  for (const auto& [cpp, c] : names) {
    for (std::size_t place = message.find(cpp); place != std::string::npos;
         place = message.find(cpp, place + 1)) {
      const auto end = message.begin() + static_cast<std::ptrdiff_t>(place);
      if (std::count(message.begin(), end, '\'') % 2 == 0) message.replace(place, cpp.size(), c);
    }
  }
  return message;
}

}  // namespace

void cutTo(char (&buffer)[504], std::string_view message) {
  std::size_t length = std::min(message.size(), sizeof(buffer) - 1);
  if (length < message.size()) {
    while (length > 0 && (static_cast<unsigned char>(message[length]) & 0xc0) == 0x80) --length;
  }
  std::memcpy(buffer, message.data(), length);
  buffer[length] = '\0';
}

dermis_code report(dermis_error* error, dermis_code code, std::string_view message,
                   std::int32_t vulkanResult) {
  if (error == nullptr) return code;
  error->code = code;
  error->vulkan_result = vulkanResult;
  try {
    cutTo(error->message, inWordsOfC(std::string(message)));
  } catch (...) {  // no memory
    cutTo(error->message, message);
  }
  return code;
}

Error callbackError(dermis_code code, const dermis_error& error, const char* callback) {
  // The caller may have filled the message without a zero at the end.
  const char* end = std::find(error.message, std::end(error.message), '\0');
  Error result{ErrorCode::vulkanError, std::string(error.message, end), error.vulkan_result};
  if (code >= DERMIS_INVALID_ARGUMENT && code <= DERMIS_IO_ERROR)
    result.code = static_cast<ErrorCode>(static_cast<int>(code) - 1);
  if (result.message.empty())
    result.message = std::string(callback) + " returned " + std::to_string(code);
  return result;
}

void checkSize(const void* structure, std::size_t known, const char* name, bool isFilled) {
  std::uint32_t size = 0;
  std::memcpy(&size, structure, sizeof(size));
  if (size < known || size > 4096) {
    fail(std::string(name) + ": its size is " + std::to_string(size) + ", not " +
         std::to_string(known));
  }
  if (!isFilled) return;
  const auto* bytes = static_cast<const unsigned char*>(structure);
  if (std::any_of(bytes + known, bytes + size, [](unsigned char byte) { return byte != 0; }))
    fail(std::string(name) + ": a member that this version does not know is not 0");
}

}  // namespace dermis::c
