// Errors as values.

#include "dermis/result.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <string>

namespace dermis::test {
namespace {

TEST(Result, HoldsAValue) {
  Result<std::string> result(std::string("value"));
  EXPECT_TRUE(result.ok());
  EXPECT_TRUE(static_cast<bool>(result));
  EXPECT_EQ(result.value(), "value");
  EXPECT_EQ(*result, "value");
  EXPECT_EQ(result->size(), 5u);
  result->append("s");
  EXPECT_EQ(static_cast<const Result<std::string>&>(result).value(), "values");
  EXPECT_EQ(static_cast<const Result<std::string>&>(result)->size(), 6u);
}

TEST(Result, HoldsAnError) {
  const Result<int> result(Error{ErrorCode::vulkanError, "vkCreateDevice failed", -3});
  EXPECT_FALSE(result.ok());
  EXPECT_FALSE(static_cast<bool>(result));
  EXPECT_EQ(result.error().code, ErrorCode::vulkanError);
  EXPECT_EQ(result.error().message, "vkCreateDevice failed");
  EXPECT_EQ(result.error().vulkanResult, -3);
}

// A value that is itself an error is no contradiction.
TEST(Result, TellsAnErrorFromAValueOfTheSameType) {
  const Result<bool> no(false);
  EXPECT_TRUE(no.ok());
  EXPECT_FALSE(no.value());
}

TEST(Result, GivesUpAValueThatCanOnlyBeMoved) {
  Result<std::unique_ptr<int>> result(std::make_unique<int>(7));
  const std::unique_ptr<int> taken = std::move(result).value();
  EXPECT_EQ(*taken, 7);
  Result<std::unique_ptr<int>> second(std::make_unique<int>(8));
  const std::unique_ptr<int> another = *std::move(second);
  EXPECT_EQ(*another, 8);
}

TEST(Result, OfNothing) {
  const Result<void> good;
  EXPECT_TRUE(good.ok());
  EXPECT_TRUE(static_cast<bool>(good));
  const Result<void> bad(Error{ErrorCode::ioError, "no such file"});
  EXPECT_FALSE(bad.ok());
  EXPECT_FALSE(static_cast<bool>(bad));
  EXPECT_EQ(bad.error().code, ErrorCode::ioError);
  EXPECT_EQ(bad.error().vulkanResult, 0);
}

TEST(Result, EveryCodeHasItsName) {
  const std::pair<ErrorCode, std::string_view> names[] = {
      {ErrorCode::invalidArgument, "invalidArgument"},
      {ErrorCode::invalidMesh, "invalidMesh"},
      {ErrorCode::invalidData, "invalidData"},
      {ErrorCode::unsupportedVersion, "unsupportedVersion"},
      {ErrorCode::unsupportedFeature, "unsupportedFeature"},
      {ErrorCode::limitExceeded, "limitExceeded"},
      {ErrorCode::notPrepared, "notPrepared"},
      {ErrorCode::missingEntryPoint, "missingEntryPoint"},
      {ErrorCode::missingFeature, "missingFeature"},
      {ErrorCode::vulkanError, "vulkanError"},
      {ErrorCode::shaderError, "shaderError"},
      {ErrorCode::ioError, "ioError"}};
  for (const auto& [code, name] : names) EXPECT_EQ(errorCodeName(code), name);
  EXPECT_EQ(errorCodeName(static_cast<ErrorCode>(200)), "unknown");
}

}  // namespace
}  // namespace dermis::test
