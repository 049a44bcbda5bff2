#pragma once

#include <span>
#include <string>

#include "walls/config/findings.h"
#include "walls/config/toml_document.h"

namespace hpr {

/// Puts values over those of a wall file: each override is PATH=VALUE, a path of keys and places in arrays (from 0)
/// between dots, e.g. viewers.0.position_m=[0,1.6,0.5]. What is not there is made; the place after an array's last
/// appends. A value is TOML, or a bare word that stands for a string. Places of such values name the override by its
/// number, from 1. A path that leads nowhere is a finding.
/// Throws Error (Usage) for what is no override.
void apply_overrides(TomlValue& document, std::span<const std::string> overrides, Findings& findings);

}  // namespace hpr
