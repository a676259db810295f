# foc33: builds the firmware for the PC, runs it on the virtual board, and tests it. `make` alone lists the targets.
#
# Variables: SCENARIO MOTOR OUT (what to run, where to write), VARIANT DEFINES USERPARAMS SAN (a build in a folder of its own),
# ONLY (names of test suites), PYTHON RUBY CC (tools to use), V=1 (show the commands).

SCENARIO ?= demo
MOTOR ?=
OUT ?=
VARIANT ?=
DEFINES ?=
USERPARAMS ?=
SAN ?=
WERROR ?=
ONLY ?=
PYTHON ?=
RUBY ?= ruby
V ?=
ifeq ($(origin CC),default)
CC := gcc
endif
AR ?= ar
export CC PYTHON RUBY

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SECONDARY:
MAKEFLAGS += --no-builtin-rules --no-print-directory
ifeq ($(MAKELEVEL),0)
MAKEFLAGS += -j$(shell getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)
endif

# ---- folders and flags -------------------------------------------------------------------------------------------------
suffix := $(if $(VARIANT),-$(VARIANT))$(if $(SAN),-san)
B := build/host$(suffix)
T := build/test$(suffix)

warnings := -Wall -Wextra -Wconversion -Wshadow
ifdef SAN
sanitizer := -fsanitize=undefined,address -fno-sanitize-recover=all -fno-omit-frame-pointer
endif

# A macro's expansion is not followed in messages: parameters come from long chains of macros (include/drive/params.h).
CFLAGS := -std=gnu99 -O2 -g -fPIC $(warnings) $(if $(WERROR),-Werror) -ftrack-macro-expansion=0 $(sanitizer)
INCLUDES := $(if $(USERPARAMS),-I$(USERPARAMS)) -Itools/host -Iinclude -I.
compile = $(CC) $(CFLAGS) $(INCLUDES) $(DEFINES)

firmware_sources := $(wildcard firmware/*/*.c) tools/host/xc.c
board_sources := $(wildcard tools/board/*.c)
firmware_objects := $(firmware_sources:%.c=$B/%.o)
board_objects := $(board_sources:%.c=$B/%.o)

quiet := $(if $(V),,@)
say = $(if $(V),,@printf '  %-4s %s\n' $1 $2;)
quoted = '$(subst ','\'',$1)'
# Writes the text to the target only if it differs, so that what depends on the target is made again only then.
remember = @mkdir -p $(@D); printf '%s\n' $(call quoted,$1) | cmp -s - $@ || printf '%s\n' $(call quoted,$1) >$@

# ---- help --------------------------------------------------------------------------------------------------------------
.PHONY: help
help: ## this list
	@sed -n 's/^\([a-z0-9-]*\):[^#]*## \(.*\)/\1\t\2/p' Makefile | while IFS="$$(printf '\t')" read -r target text; do \
	    printf '  make %-12s %s\n' "$$target" "$$text"; done

# ---- firmware and virtual board on the PC --------------------------------------------------------------------------------
.PHONY: lib vboard FORCE
lib: $B/libfirmware.a ## build/host/libfirmware.a: the firmware compiled for the PC [DEFINES= USERPARAMS=folder VARIANT= SAN=1]

vboard: $B/libvboard.so ## build/host/libvboard.so: the virtual board with the firmware in it [the same variables]

$B/flags: FORCE
	@if [ -n '$(USERPARAMS)' ] && [ ! -f '$(USERPARAMS)/userparams.h' ]; then \
	    echo "foc33: USERPARAMS=$(USERPARAMS): no userparams.h there, name a folder that has one" >&2; exit 2; fi
	$(call remember,$(compile))

$B/contents: FORCE
	$(call remember,$(firmware_objects) $(board_objects))

$B/%.o: %.c $B/flags
	@mkdir -p $(@D)
	$(call say,cc,$<)$(compile) -MMD -MP -c $< -o $@

$B/libfirmware.a: $(firmware_objects) $B/contents
	@rm -f $@
	$(call say,ar,$@)$(AR) rcs $@ $(firmware_objects)

$B/libvboard.so: $(board_objects) $(firmware_objects) $B/contents
	$(call say,ld,$@)$(CC) -shared $(if $(SAN),$(sanitizer),-Wl$(comma)--no-undefined) -o $@ \
	    $(board_objects) $(filter-out %/main.o,$(firmware_objects)) -lm

# ---- runs ----------------------------------------------------------------------------------------------------------------
# The front end may call make for other variants: it must not take this make's jobs and variables for its own.
front_end = env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL "$$(cat build/setup/python)" -m tools.foc33
options = $(if $(MOTOR),--motor $(call quoted,$(MOTOR))) $(if $(OUT),--out $(call quoted,$(OUT)))

.PHONY: run scenarios table2 starts setup-run
run: setup-run ## the firmware turns the motor on the virtual board: table, plots, trace [SCENARIO=demo MOTOR= OUT=folder]
	@$(MAKE) vboard
	@$(front_end) run $(call quoted,$(SCENARIO)) $(options)

scenarios: setup-run ## list the scenarios for make run SCENARIO=name
	@$(front_end) scenarios

table2: setup-run ## the eight rows of the note's Table 2 beside ours [MOTOR= OUT=folder]
	@$(MAKE) vboard
	@$(front_end) table2 $(options)

starts: setup-run ## start from every rotor angle under several loads [MOTOR= OUT=folder]
	@$(MAKE) vboard
	@$(front_end) starts $(options)

setup-run:
	@tools/setup/prepare.sh run

# ---- tests ---------------------------------------------------------------------------------------------------------------
CEEDLING := 1.2.1
gem := build/gems/gems/ceedling-$(CEEDLING)
gem_stamp := build/gems/ceedling-$(CEEDLING).stamp
unity := $(gem)/vendor/unity
cmock := $(gem)/vendor/cmock

unit_suites := $(patsubst test/%.c,%,$(wildcard test/unit/test_*.c)) $(patsubst test/%.py,%,$(wildcard test/unit/check_*.py))
board_suites := $(patsubst test/%.c,%,$(wildcard test/board/test_*.c))
tools_suites := $(patsubst test/%.py,%,$(wildcard test/tools/test_*.py))
behaviour_suites := $(patsubst test/%.c,%,$(wildcard test/behaviour/test_*.c)) $(patsubst test/%.py,%,$(wildcard test/behaviour/test_*.py))
modes := default OPEN_LOOP_FUNCTIONING TUNING TORQUE_MODE BIDIRECTIONAL_SPEED SNAPSHOT
warning_suites := $(modes:%=warnings/%)
quick_suites := $(unit_suites) $(board_suites) $(tools_suites)
all_suites := $(warning_suites) $(behaviour_suites) $(quick_suites)

chosen = $(if $(ONLY),$(filter $(foreach o,$(ONLY),$o %/$o),$1),$1)
results = $(patsubst %,$T/%.txt,$(subst /,.,$1))
# Every suite runs anew and leaves its report in $T/*.txt; a suite that cannot be built leaves none, which the last step counts as failed.
run_suites = @rm -f $T/*.txt; $(MAKE) -k WERROR=$(WERROR) $(call results,$(call chosen,$1)) || true; \
	"$$(cat build/setup/python)" test/run-report.py $T $(subst /,.,$(call chosen,$1))

.PHONY: test test-quick setup-test
test: setup-test ## every test; last line "N passed, N failed" [ONLY="test_pi ..."]
	@$(MAKE) $(gem_stamp)
	$(call run_suites,$(all_suites))

test-quick: setup-test ## the tests for the edit loop, under 30 s [ONLY="test_pi ..."]
	@$(MAKE) $(gem_stamp)
	$(call run_suites,$(quick_suites))

setup-test:
	@tools/setup/prepare.sh test

$(gem_stamp):
	@tools/setup/gems.sh $(CEEDLING) $@

run_suite = @"$$(cat build/setup/python)" test/run-suite.py $@

$T/unit.test_%.txt: $T/unit/test_%
	$(run_suite) $<

$T/unit.check_%.txt: test/unit/check_%.py FORCE
	$(run_suite) "$$(cat build/setup/python)" $<

$T/board.test_%.txt: $T/board/test_%
	$(run_suite) $<

c_behaviour := $(filter $(patsubst test/%.c,%,$(wildcard test/behaviour/test_*.c)),$(behaviour_suites))
$(call results,$(c_behaviour)): $T/behaviour.%.txt: $T/behaviour/%
	$(run_suite) $<

$(call results,$(filter-out $(c_behaviour),$(behaviour_suites))): $T/behaviour.%.txt: test/behaviour/%.py $B/libvboard.so FORCE
	$(run_suite) "$$(cat build/setup/python)" test/run-unittest.py $<

$T/tools.test_%.txt: test/tools/test_%.py $B/libvboard.so FORCE
	$(run_suite) "$$(cat build/setup/python)" test/run-unittest.py $<

$T/warnings.%.txt: FORCE
	@+"$$(cat build/setup/python)" test/run-suite.py --single $@ \
	    $(MAKE) -s WERROR=1 SAN= VARIANT=warnings-$* DEFINES=$(if $(filter-out default,$*),-D$*) lib vboard

# A test's own flags stand in its first lines: /* defines: -DTUNING */. They act on the test and its runner, not on the library.
own_defines = $$(sed -n '1,5s@.*/\* defines: \(.*\) \*/.*@\1@p' $1)
test_includes := -Itest/unit/support -Itools/board $(patsubst %/,-I%,$(wildcard include/*/)) -I$T/mocks \
    -isystem $(unity)/src -isystem $(cmock)/src
test_compile = $(CC) $(filter-out $(warnings) -Werror,$(CFLAGS)) $(INCLUDES) $(test_includes) -DUNITY_INCLUDE_CONFIG_H $(DEFINES)

$T/flags: FORCE
	$(call remember,$(test_compile))

$T/%.o: test/%.c $T/flags
	@mkdir -p $(@D)
	$(call say,cc,$<)$(test_compile) $(warnings) -Werror $(call own_defines,$<) -MMD -MP -c $< -o $@

$T/%_runner.c: test/%.c test/unit/support/cmock.yml $(gem_stamp)
	@mkdir -p $(@D)
	$(quiet)$(RUBY) $(unity)/auto/generate_test_runner.rb test/unit/support/cmock.yml $< $@ >$@.log || { cat $@.log >&2; exit 1; }

$T/%_runner.o: $T/%_runner.c $T/flags
	$(quiet)$(test_compile) -w $(call own_defines,test/$*.c) -Itest/$(*D) -MMD -MP -c $< -o $@

$T/unity.o: $(gem_stamp) $T/flags
	$(quiet)$(test_compile) -w -c $(unity)/src/unity.c -o $@

$T/cmock.o: $(gem_stamp) $T/flags
	$(quiet)$(test_compile) -w -c $(cmock)/src/cmock.c -o $@

# mock_x.h in a test stands for the x.h of any folder in include/.
$T/mocks/mock_%.c: test/unit/support/cmock.yml $(gem_stamp)
	@mkdir -p $(@D)
	$(quiet)$(RUBY) $(cmock)/lib/cmock.rb -o$< --mock_path=$(@D) $(wildcard include/*/$*.h) >$@.log || { cat $@.log >&2; exit 1; }

$T/mocks/mock_%.o: $T/mocks/mock_%.c $T/flags
	$(quiet)$(test_compile) -w -MMD -MP -c $< -o $@

link_test = $(quiet)$(CC) $(sanitizer) -o $@ $^ -lm

$(unit_c:%=$T/%): $T/%: $T/%.o
