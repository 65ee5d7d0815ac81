// What the converter throws: what was found, where, what is allowed and how to mend it. Tools print what() and exit
// with 2 for an Error and 1 for a ThresholdError.
#ifndef DCLOTH_CONVERTER_ERROR_H_
#define DCLOTH_CONVERTER_ERROR_H_

#include <filesystem>
#include <stdexcept>
#include <string>

namespace dcloth::converter {

struct ErrorParts {
  std::filesystem::path path;  // empty where no file is concerned
  std::string tensor;          // empty where no tensor is concerned
  std::string found;
  std::string expected;
  std::string mend;  // may be empty where `expected` says it all
};

class Error : public std::runtime_error {
 public:
  explicit Error(ErrorParts parts);
  const ErrorParts& parts() const { return parts_; }

 private:
  ErrorParts parts_;
};

// The input is good, but a bound the user set is missed. Nothing is written.
class ThresholdError : public Error {
 public:
  using Error::Error;
};

// Text out of an untrusted file for a terminal or a log: control characters, those beyond ASCII too, and bytes that are
// not UTF-8 become '?'. what() treats every part so.
std::string PrintableText(const std::string& raw);

// Six significant digits at most: "0.5", "3e+38".
std::string NumberText(double value);

// The path as such text.
std::string PathText(const std::filesystem::path& path);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_ERROR_H_
