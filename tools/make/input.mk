# What was typed on make's command line and what this make needs, looked at before any work. The makes that it starts are not asked again.
ifeq ($(MAKELEVEL),0)
goals := $(or $(MAKECMDGOALS),help)
given = $(filter command environment,$(firstword $(origin $1)))
# good(command): what it says goes to the user, and if it fails, nothing else is done.
good = $(shell { $1; } >&2)$(if $(filter-out 0,$(.SHELLSTATUS)),$(error nothing was done))

typed := $(foreach name,$(.VARIABLES),$(if $(filter command,$(call given,$(name))),$(name)))
$(if $(typed),$(call good,awk -v typed='$(typed)' -v goals=$(call quoted,$(goals)) -f tools/make/nearest.awk -f tools/make/input.awk Makefile $(part_makefiles)))

# A tool that was asked for; the usual ones are installed.
$(foreach tool,CC RUBY,$(if $(filter-out gcc ruby,$(firstword $($(tool)))),$(call good,set -- $($(tool)); command -v "$$1" >/dev/null || \
    { printf 'foc33: no command %s$(comma) %s: name one that is there\n' "$$1" $(call quoted,$(tool)=$($(tool))); exit 1; })))

# build/ and the folders in it, which may be from another user's make.
$(if $(filter-out help,$(goals)),$(call good,if test -e build || test -L build; then bad=build; \
    test -d build && bad=$$(find build -maxdepth 1 -type d ! '(' -readable -writable -executable ')' -print -quit 2>/dev/null); \
    else bad=; test -w . || bad=.; fi; test -z "$$bad" || { printf 'foc33: cannot read and write %s$(comma) %s: change owner and permissions\n' \
    "$$bad" $(call quoted,$(CURDIR)); exit 1; }))
# Room for what a build writes there and, as the compiler does, into the folder of temporary files.
$(if $(filter-out help clean,$(goals)),$(call good,tools/make/room.sh))
endif
