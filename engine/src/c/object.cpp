#include "object.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>

namespace dermis::c {

dermis_code report(dermis_error* error, dermis_code code, std::string_view message,
                   std::int32_t vulkanResult) {
  if (error == nullptr) return code;
  error->code = code;
  error->vulkan_result = vulkanResult;
  std::size_t length = std::min(message.size(), sizeof(error->message) - 1);
  // A cut message does not end inside a character.
  if (length < message.size()) {
    while (length > 0 && (static_cast<unsigned char>(message[length]) & 0xc0) == 0x80) --length;
  }
  std::memcpy(error->message, message.data(), length);
  error->message[length] = '\0';
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
