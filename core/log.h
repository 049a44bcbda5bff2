#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

/// One line per message on stderr, rank first when there are several. Never in a per-pixel path.
namespace hpr::log {

enum class Level { Error, Warning, Info, Debug };

/// Messages above `level` are dropped; `prefix` ("rank 3 on host: ") stands before every message.
void configure(Level level, std::string prefix);
void write(Level level, std::string_view message);

template <typename... Args>
void error(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::Error, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void warning(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::Warning, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void info(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::Info, fmt::format(format, std::forward<Args>(args)...));
}
template <typename... Args>
void debug(fmt::format_string<Args...> format, Args&&... args) {
  write(Level::Debug, fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace hpr::log
