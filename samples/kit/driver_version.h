// The driver of a device, so that measurements can be compared.
#pragma once

#include <string>

#include "kit/device.h"

namespace dermis::samples {

/// "llvmpipe Mesa 22.3.6 (LLVM 15.0.6)", or only a number if the driver does not report more.
std::string driverVersion(const Device& device);

}  // namespace dermis::samples
