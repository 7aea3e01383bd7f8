// What decides whether a frame skins an instance, settles it or leaves it. All of it is in the two
// tables below, from which docs/states.md is made.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace dermis {

/// Whether the last frame displayed an instance, and whether the next one will, which is bit 0.
enum class View : std::uint8_t {
  leaving,    ///< the last one did
  shown,      ///< both; so begins a new instance
  hidden,     ///< neither
  returning,  ///< the next one will
};

/// What changes the view. `execute`: a frame was executed.
enum class ViewEvent : std::uint8_t { hide, show, execute };

inline constexpr std::array<std::array<View, 3>, 4> viewAfter{{
    //                hide           show             execute
    /* leaving   */ {View::leaving, View::shown, View::hidden},
    /* shown     */ {View::leaving, View::shown, View::shown},
    /* hidden    */ {View::hidden, View::returning, View::hidden},
    /* returning */ {View::hidden, View::returning, View::shown},
}};

constexpr View after(View view, ViewEvent event) {
  return viewAfter[static_cast<std::size_t>(view)][static_cast<std::size_t>(event)];
}
constexpr bool isDisplayed(View view) {
  return (static_cast<unsigned>(view) & 1) != 0;
}
// Showing what is displayed, or hiding what is not, changes nothing: `SceneBooks::turn` uses that.
static_assert(std::ranges::all_of(viewAfter, [](const auto& row) {
  const auto view = static_cast<View>(&row - viewAfter.data());
  return isDisplayed(row[1]) && !isDisplayed(row[0]) && isDisplayed(row[2]) == isDisplayed(view) &&
         row[isDisplayed(view) ? 1 : 0] == view;
}));

/// What is out of date about the vertices of an instance. A change may only raise it; once it is
/// skinned, it is `none`.
enum class Need : std::uint8_t {
  none,     ///< nothing
  stale,    ///< they are those of another pose or other morph weights
  urgent,   ///< of another pose object or method: skinned whatever the update interval is
  restart,  ///< they cannot be compared with the next ones: the instance is new, teleports, has
            ///< another mesh or box, or its last frame was abandoned
};

/// What a frame does with an instance.
enum class Action : std::uint8_t {
  leave,    ///< nothing
  settle,   ///< previous positions become the current ones, if they differ
  onBeat,   ///< `skin` if the update interval permits it, otherwise `settle`
  skin,     ///< the current positions become the previous ones
  restart,  ///< skin; previous positions become the new ones
};

inline constexpr std::array<std::array<Action, 4>, 4> actions{{
    //                none            stale            urgent           restart
    /* leaving   */ {Action::leave, Action::leave, Action::leave, Action::leave},
    /* shown     */ {Action::settle, Action::onBeat, Action::skin, Action::restart},
    /* hidden    */ {Action::leave, Action::leave, Action::leave, Action::leave},
    /* returning */ {Action::settle, Action::restart, Action::restart, Action::restart},
}};

/// `isOnBeat`: the update interval permits to skin it in this frame.
constexpr Action actionFor(View view, Need need, bool isOnBeat) {
  const Action action = actions[static_cast<std::size_t>(view)][static_cast<std::size_t>(need)];
  if (action != Action::onBeat) return action;
  return isOnBeat ? Action::skin : Action::settle;
}

}  // namespace dermis
