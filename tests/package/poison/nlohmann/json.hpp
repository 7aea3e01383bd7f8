#error "dermis::core must not need <nlohmann/json.hpp>"
