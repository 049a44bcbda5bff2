#include "core/log.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>

namespace hpr::log {
namespace {

struct State {
  std::shared_ptr<spdlog::logger> logger = [] {
    auto made = std::make_shared<spdlog::logger>("hpr", std::make_shared<spdlog::sinks::stderr_sink_mt>());
    made->set_pattern("hpr: %v");
    made->flush_on(spdlog::level::trace);
    return made;
  }();
  std::string prefix;
};

State& state() {
  static State the_state;
  return the_state;
}

spdlog::level::level_enum to_spdlog(Level level) {
  switch (level) {
    case Level::Error:
      return spdlog::level::err;
    case Level::Warning:
      return spdlog::level::warn;
    case Level::Info:
      return spdlog::level::info;
    case Level::Debug:
      return spdlog::level::debug;
  }
  return spdlog::level::info;
}

}  // namespace

void configure(Level level, std::string prefix) {
  state().logger->set_level(to_spdlog(level));
  state().prefix = std::move(prefix);
}

void write(Level level, std::string_view message) {
  const std::string_view kind = level == Level::Error ? "error: " : level == Level::Warning ? "warning: " : "";
  state().logger->log(to_spdlog(level), "{}{}{}", state().prefix, kind, message);
}

}  // namespace hpr::log
