# foc33: builds the firmware for the PC, runs it on the virtual board, and tests it. `make` alone lists the targets.
#
# Variables: SCENARIO MOTOR BOARD SET OUT (what to run, on which board, where to write), DEFINES USERPARAMS APP (which firmware), VARIANT SAN (a build in
# a folder of its own; of make bringup a miswired board), ONLY (names of test suites), PYTHON RUBY CC (tools to use), INSTALL=no (say what is missing, install nothing),
# FOC33_QUIET=1 (no progress), V=1 (show the commands).

RUBY ?= ruby
ifeq ($(origin CC),default)
CC := gcc
endif
export CC PYTHON RUBY INSTALL
# What would keep Python from finding tools/, and matplotlib from drawing into files.
unexport PYTHONSAFEPATH MPLBACKEND
# Hundreds of commands import the same modules: they are compiled once, into build/, whatever else was asked for.
unexport PYTHONDONTWRITEBYTECODE
export PYTHONPYCACHEPREFIX := $(CURDIR)/build/pycache

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SECONDARY:
MAKEFLAGS += --no-builtin-rules --no-print-directory
ifeq ($(MAKELEVEL),0)
MAKEFLAGS += -j$(shell getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)
endif

# ---- folders and flags ---------------------------------------------------------------------------------------------------
ifneq ($(filter bringup,$(MAKECMDGOALS)),)
board_variant := $(VARIANT)
override VARIANT :=
endif
suffix := $(if $(VARIANT),-$(VARIANT))$(if $(SAN),-san)
B := build/host$(suffix)
T := build/test$(suffix)

warnings := -Wall -Wextra -Wconversion -Wshadow
ifneq ($(SAN),)
warnings += -Wno-sign-conversion # the checks that the compiler inserts make it see conversions that are not in the source
sanitizer := -fsanitize=undefined,address -fno-sanitize-recover=all -fno-omit-frame-pointer
endif
# Messages do not follow a macro's expansion: a wrong parameter is named once, not with the chain of macros that uses it.
# What a build compiles anew, firmware and tests, at -O1: in half the time, and the virtual board runs no slower. The board itself, compiled once, at -O3.
CFLAGS := -std=gnu99 -O1 -g -fPIC -fno-semantic-interposition -ftrack-macro-expansion=0 $(sanitizer)
INCLUDES = $(if $(USERPARAMS),-I$B/header -I$(call quoted,$(USERPARAMS))) -Itools/cpu_host -Iinclude -I.
compile = $(CC) $(CFLAGS) $(warnings) $(if $(WERROR),-Werror) $(INCLUDES) $(DEFINES) $(app_wishes)

# The virtual board: plant, chip, the board itself, and the processor that is the firmware built for the PC.
board_rooms := $(addprefix tools/,plant chip vboard cpu_host)
board_includes := $(board_rooms:%=-I%)
# One unit of them all but the application, as the image (tools/make/image.mk); the parameters' checks are no code, and a harness may have a loop of its own.
params_source := firmware/drive/param_text.c firmware/drive/param_check.c
# The application: a file of firmware/app by its name, or a path to any, which is copied as userparams.h is. APP=panel if none is named.
app_copy := build/app$(suffix)/app.c
app_source := $(or $(wildcard firmware/app/$(or $(filter-out .%,$(APP)),panel).c),$(app_copy))
firmware_sources := $(filter-out $(params_source) firmware/app/%,$(wildcard firmware/*/*.c firmware/*/*/*.c))
includes_of = $(foreach file,$1,'$(hash)include "$(file)"')
hash := \#
unit := $B/unit.o
firmware_objects := $(unit) $B/app.o $B/firmware/board/main.o $B/tools/cpu_host/xc.o
# Each file alone, so that a test or a mock may take the place of any.
part_objects := $(firmware_sources:%.c=$B/%.o) $B/app.o $B/tools/cpu_host/xc.o
# All variants share the board but for its view into the firmware, unless they compile in a way of their own.
own_way := $(SAN)$(filter command%,$(origin CC) $(origin CFLAGS) $(origin warnings))
board_folder := $(if $(own_way),$B,build/board$(if $(WERROR),-strict))
probe := $B/tools/cpu_host/probe.o
board_objects := $(probe) $(patsubst %.c,$(board_folder)/%.o,$(filter-out tools/cpu_host/xc.c tools/cpu_host/probe.c,$(wildcard $(board_rooms:%=%/*.c))))

part_makefiles := $(wildcard tools/make/*.mk)

quiet := $(if $(V),,@)
say = $(if $(V),,@printf '  %-4s %s\n' $1 $2;)
comma := ,
quoted = '$(subst ','\'',$1)'
# What an application asks of the board by what it includes.
app_wishes := $(shell grep -qE '^ *$(hash) *include *"app/line\.h"' $(call quoted,$(or $(filter-out $(app_copy),$(app_source)),$(APP))) 2>/dev/null && echo -DAPP_SERIAL=1)
app_wishes += $(shell grep -qE '^ *$(hash) *include *"app/pulse\.h"' $(call quoted,$(or $(filter-out $(app_copy),$(app_source)),$(APP))) 2>/dev/null && echo -DAPP_PULSE=1)
# Writes the text to the target only if it is new, so that what depends on the target is made again only then.
remember_lines = @mkdir -p $(@D); printf '%s\n' $1 | cmp -s - $@ || printf '%s\n' $1 >$@
remember = @mkdir -p $(@D); printf '%s\n' $(call quoted,$1) | cmp -s - $@ || printf '%s\n' $(call quoted,$1) >$@

# Whoever compiles holds build/lock or its variant's, so that two makes in this tree take turns; what such a make starts holds it, too.
lock_file = $(if $(FOC33_LOCK),,mkdir -p build; exec 9>$1; flock -n 9 || { echo "waiting for another make"; flock 9; }; export FOC33_LOCK=1;)
lock = $(call lock_file,build/lock$(suffix))
# A disk that has filled up meanwhile is named in one line below what the compiler says of it.
build = +@$(lock) $(if $2,$(still) '$2') $(MAKE) $1 || { status=$$?; tools/make/room.sh >&2; exit $$status; }
# What the variants share is made before: under one lock for all.
shared = ($(call lock_file,build/lock) $(MAKE) -s VARIANT= SAN= $(golden_stamp) build/iss/libiss33f.a) &&
# The rest of the line runs alone among all makes of this tree with the same target.
in_turn = mkdir -p build; flock build/$@.lock

need_header = @test -f $(call quoted,$(or $(USERPARAMS),.)/userparams.h) || { \
    echo foc33: no userparams.h, $(call quoted,USERPARAMS=$(USERPARAMS)): name a folder that has one >&2; exit 2; }

# The header of the folder USERPARAMS: a copy, because make cannot read the names of files whose path has blanks, and because a build keeps
# what it began with. #line tells the compiler, and so the user, where the text is from.
define copy_header
$(need_header)
@mkdir -p $(@D); { printf '#line 1 "%s"\n' "$$(printf %s $(call quoted,$(USERPARAMS)/userparams.h) | sed 's/[\\"]/\\&/g')"; \
    cat $(call quoted,$(USERPARAMS)/userparams.h); } >$@.new && { cmp -s $@.new $@ && rm $@.new || mv $@.new $@; }
endef

# A misspelt mode would give the drive without it, and -DTUNING=0 the drive with it.
known_defines = @$(foreach word,$(firstword $(filter-out -D% -U%,$(DEFINES)) $(filter-out %=1,$(filter $(modes:%=-D%=%),$(DEFINES))) \
    $(filter-out $(modes:%=-D%) -U%,$(foreach word,$(DEFINES),$(if $(findstring =,$(word)),,$(word))))), \
    echo foc33: $(call quoted,no mode $(word)$(comma) DEFINES=$(DEFINES)): 'use $(modes:%=-D%) or -DNAME=value' >&2; exit 2)
# The header would win over a parameter's -D, but for those that it asks about.
no_parameters = @for word in $(foreach word,$(filter -D%,$(DEFINES)),$(call quoted,$(patsubst -D%,%,$(word)))); do name="$${word%%=*}"; \
    test "$$name" = "$$word" || ! grep -q "^ *\# *define  *$$name[ (]" $(call quoted,$(or $(USERPARAMS),.)/userparams.h) || \
    grep -q "^ *\# *ifndef  *$$name\b" $(call quoted,$(or $(USERPARAMS),.)/userparams.h) || { \
    echo "foc33: $$name is a parameter," $(call quoted,DEFINES=$(DEFINES)): set it in userparams.h >&2; exit 2; }; done

# Both libraries of a build's folder.
libraries = $(addprefix $1/,libfirmware.a libvboard.so)

# ---- help ----------------------------------------------------------------------------------------------------------------
# A target's line: "## [group] what it does [variables]".
help_groups := run 'your motor' 'your board' tests simulator upkeep
.PHONY: help
help: ## [upkeep] this list
	@for group in $(help_groups); do printf '%s\n' "$$group"; \
	    sed -n "s/^\([a-z0-9-]*\):.*## \[$$group\] \(.*\)/\1|\2/p" Makefile $(part_makefiles) | while IFS='|' read -r target text; do \
	    printf '  make %-12s %s\n' "$$target" "$$text"; done; done

# ---- runs ----------------------------------------------------------------------------------------------------------------
# The front end calls make for the variant that a scenario needs: it must not take over this make's jobs and folder. ASKED_BY: its lines name make's variables.
alone = env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u VARIANT -u SAN -u WERROR -u USERPARAMS -u DEFINES ASKED_BY=make
python = "$$(cat build/setup/python)"
# Says now and then that a silent command still runs: $(still) title command
still = python3 -m tools.common.progress
front_end = $(alone) $(python) -m tools.bench
out = $(if $(OUT),--out $(call quoted,$(OUT)))

# A motor runs with the userparams.h that the tuner writes for it, unless USERPARAMS names another folder.
tuner = $(alone) $(python) -m tuning
board = $(if $(BOARD),--board $(call quoted,$(BOARD)))
what = $(if $(MOTOR),--motor $(call quoted,$(MOTOR))) $(board) $(if $(USERPARAMS),--userparams $(call quoted,$(USERPARAMS)))
options = $(what) $(out)
scenario = $(if $(SCENARIO),$(call quoted,$(SCENARIO))) $(if $(DEFINES),--defines=$(call quoted,$(DEFINES))) $(if $(APP),--app $(call quoted,$(APP)))
ready = $(if $(USERPARAMS)$(DEFINES)$(APP),:,$(if $(MOTOR),$(tuner) tune $(call quoted,$(MOTOR)) $(board) --brief,$(MAKE) vboard))

# MOTOR=all: the target for each motor of tuning/motors, with its own header; fails at the end if one of them did.
every = $(filter all,$(MOTOR))
every_motor = failed=; for motor in $(basename $(notdir $(wildcard tuning/motors/*.toml))); do \
    $(MAKE) $@ MOTOR=$$motor $(if $(OUT),OUT=$(call quoted,$(OUT))/$$motor) || failed="$$failed $$motor"; done; \
    test -z "$$failed" || { echo "foc33: $@ fails for$$failed" >&2; exit 1; }

.PHONY: sensitivity anymotor bringup run recorder scenarios keys registers list-motors table2 starts motors robust loadsteps lowspeed catch pulse held setup-run
run: setup-run ## [run] turn the motor on the virtual board: table, plots, trace [SCENARIO=demo MOTOR= BOARD= DEFINES=-D... APP=name USERPARAMS= OUT=folder]
	@$(if $(scenario)$(what),$(front_end) prepare $(scenario) $(what))
	@+$(ready)
	@$(front_end) run $(scenario) $(options)

recorder: setup-run ## [run] draw what the fault recorder has sent: a log of your board's UART, or the last run's [LOG=file MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(ready)
	@$(front_end) recorder $(if $(LOG),$(call quoted,$(LOG))) $(options)

scenarios: setup-run ## [run] list the scenarios of make run SCENARIO=name
	@$(front_end) scenarios

keys: setup-run ## [run] list the keys of the virtual board: unit, range, meaning
	@$(front_end) keys

registers: setup-run ## [run] list what the self-test REGISTERS compares: register, bits, value [DEFINES=-D... USERPARAMS=folder]
	@$(front_end) registers $(if $(DEFINES),--defines=$(call quoted,$(DEFINES))) $(if $(USERPARAMS),--userparams $(call quoted,$(USERPARAMS)))

list-motors: setup-run ## [your motor] the motor files of tuning/motors: data and rating
	@$(front_end) motors

table2: setup-run ## [run] the eight rows of AN1292's Table 2 beside ours [MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(ready)
	@$(front_end) table2 $(options)

drawn_or_full = $(if $(FULL),--full) $(if $(DRAW),--draw $(call quoted,$(DRAW))) $(if $(SEED),--seed $(call quoted,$(SEED))) \
    $(if $(CASE),--case $(call quoted,$(CASE)))
starts: setup-run ## [run] starts from every rotor angle under several loads, and with R, L, Kphi off; or drawn [FULL=1, DRAW=300 SEED=1 CASE=, MOTOR=name or all, BOARD= USERPARAMS= OUT=]
	@+$(if $(every),$(every_motor),$(ready))
	@$(if $(every),,$(front_end) starts $(drawn_or_full) $(options))

motors: setup-run ## [your motor] every motor with its own header: 20, 50, 100 % of rated speed at half torque [BOARD= OUT=]
	@$(tuner) motors $(board) $(out)

anymotor: setup-run ## [your motor] drawn motors and boards: each tuned and turning, or refused in one line [N=300 SEED=1 CASE=number OUT=]
	@$(tuner) anymotor $(if $(N),--count $(call quoted,$(N))) $(if $(SEED),--seed $(call quoted,$(SEED))) $(if $(CASE),--case $(call quoted,$(CASE))) $(out)

robust: setup-run ## [run] how far R, L and Kphi may be off before a start fails [MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(ready)
	@$(front_end) robust $(options)

loadsteps: setup-run ## [run] the brake closes and opens at once: dips, and the time back [MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(ready)
	@$(front_end) loadsteps $(options)

lowspeed: setup-run ## [run] low speeds held under load, and how low it goes [MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(ready)
	@$(front_end) lowspeed $(options)

catch: setup-run ## [run] S2 while the rotor turns at any speed, and stops on a supply that cannot sink [MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(ready)
	@$(front_end) catch $(options)

pulse: setup-run ## [run] a load that pulses with the shaft's angle, as that of a piston: mean speed and swing [MOTOR=name or all, BOARD= USERPARAMS= OUT=]
	@+$(if $(every),$(every_motor),$(ready))
	@$(if $(every),,$(front_end) pulse $(options))

held: setup-run ## [run] a shaft that is held and let go: how far it turns backwards, and what follows; or drawn [FULL=1, DRAW=300 SEED=1 CASE=, MOTOR=name or all, BOARD= USERPARAMS= OUT=]
	@+$(if $(every),$(every_motor),$(ready))
	@$(if $(every),,$(front_end) held $(drawn_or_full) $(options))

sensitivity: setup-run ## [tests] every number chosen by trial a fifth less and more: what moves, what is on an edge [ONLY="GATE_SHARE ..." ALL=1 MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(ready)
	@$(front_end) sensitivity $(if $(ALL),--all) $(if $(ONLY),--only $(foreach name,$(ONLY),$(call quoted,$(name)))) $(options)

bringup: setup-run ## [your board] what BRINGUP says of the right board and of miswired ones [VARIANT=name MOTOR= BOARD= USERPARAMS= OUT=]
	@+$(if $(MOTOR),$(ready),:)
	@$(front_end) bringup $(if $(board_variant),--variant $(call quoted,$(board_variant))) $(options)

# Each motor with the header that the tuner writes for it.
drawn_from = $(tuner) tune --all --brief >/dev/null
drawn = $(if $(SEED),--seed $(call quoted,$(SEED))) $(if $(CASE),--case $(call quoted,$(CASE))) $(if $(MOTOR),--motor $(call quoted,$(MOTOR))) $(out)
.PHONY: campaign soak
campaign: setup-run ## [tests] injected faults: ridden through, stopped by name, or wrong and silent [N=2000 SEED=1 CASE=number KIND="bus gain" MOTOR= OUT=]
	@$(drawn_from)
	@$(front_end) campaign $(if $(N),--count $(call quoted,$(N))) $(if $(KIND),--kind $(call quoted,$(KIND))) $(drawn)

soak: setup-run ## [tests] motor hours of random commands, loads, temperatures, sags, noise: nothing may trip [HOURS=24 SEED=1 CASE=number MOTOR= OUT=]
	@$(drawn_from)
	@$(front_end) soak $(if $(HOURS),--hours $(call quoted,$(HOURS))) $(drawn)

# ---- tuning --------------------------------------------------------------------------------------------------------------
tune_motor = $(call quoted,$(or $(MOTOR),hurst_dmb0224c10002))
.PHONY: tune tune-fw import identify identify-range board spreadsheet userparams setup-tune
tune: setup-run ## [your motor] data sheet to build/tune/NAME/userparams.h and a report [MOTOR=hurst_dmb0224c10002 BOARD= OUT=]
	@$(tuner) tune $(tune_motor) $(board) $(out)

tune-fw: setup-run ## [your motor] search the field-weakening tables, into tuning/tables/NAME.toml [MOTOR= BOARD= OUT=]
	@$(tuner) tune-fw $(tune_motor) $(board) $(out)

import: setup-run ## [your motor] a userparms.h of AN1292 to motor file, tables and userparams.h [HEADER=userparms.h NAME= BOARD= SET="inertia=5.5e-6 ..." DEFINES=-D...]
	@$(tuner) import $(if $(HEADER),$(call quoted,$(HEADER)) $(foreach word,$(SET),$(call quoted,$(word)))) $(if $(NAME),--name $(call quoted,$(NAME))) $(board) \
	    $(if $(DEFINES),--defines=$(call quoted,$(DEFINES)))

identify: setup-run ## [your motor] R, L, Kphi, inertia and friction as the IDENTIFY firmware measures them [MOTOR=name or all, BOARD= OUT=]
	@$(tuner) identify $(if $(filter all,$(MOTOR)),--all,$(tune_motor)) $(board) $(out)

identify-range: setup-run ## [tests] motors from 5 mohm, 10 uH, 1e-7 kg m2 to 20 ohm, 20 mH, 1 kg m2, 1 N m: measured over true [OUT=]
	@$(tuner) identify-range $(out)

userparams: setup-run ## [your motor] install the tuned header; yours is kept as userparams.h.old [MOTOR= BOARD=]
	@$(tuner) tune $(tune_motor) $(board) --brief --install

board: setup-run ## [your board] what a board measures; with SET: write the file of an inverter of your own [BOARD=mclv SET="shunt=10mohm gain=20 ..."]
	@$(tuner) board $(call quoted,$(or $(BOARD),mclv)) $(foreach word,$(SET),$(call quoted,$(word)))

spreadsheet: setup-tune ## [upkeep] write tuning/tuning_params.xlsx
	@$(tuner) spreadsheet

setup-tune:
	@tools/setup/prepare.sh tune

.PHONY: readme bench
readme: setup-run ## [upkeep] measure what the tables and pictures of README and docs/ show, and write or compare them [CHECK=1 ONLY="demo size ..."]
	@mkdir -p build; $(alone) $(python) -m tools.docs.readme $(if $(CHECK),--check) $(if $(shell command -v $(xc16)gcc),--compiler) \
	    $(foreach name,$(ONLY),$(call quoted,$(name)))

bench: ## [simulator] motor seconds that the virtual board simulates in one second of one core
	$(call build,$B/bench)
	@$B/bench

$B/bench: test/chip/bench.c $B/libvboard.so
	@$(compile) $(board_includes) -o $@.new $^ && mv $@.new $@

setup-run:
	@tools/setup/prepare.sh run

# ---- firmware and virtual board on the PC --------------------------------------------------------------------------------
.PHONY: lib vboard FORCE
lib: ## [run] build/host/libfirmware.a: the firmware as a PC library [DEFINES=-D... USERPARAMS=folder VARIANT= SAN=1]
	$(call build,$B/libfirmware.a)

vboard: ## [run] build/host/libvboard.so: the virtual board with the firmware in it [as lib]
	$(call build,$B/libvboard.so)

ifneq ($(USERPARAMS),)
$B/header/userparams.h: FORCE
	$(copy_header)
endif

$B/flags: FORCE $(if $(USERPARAMS),$B/header/userparams.h)
	$(need_header)
	$(call known_defines)
	$(no_parameters)
	$(call remember,$(compile))

apps = $(patsubst firmware/app/%.c,%,$(wildcard firmware/app/*.c))
# Not for an application of firmware/app: what was built before may still name the copy.
$(app_copy): FORCE
	$(if $(filter $@,$(app_source)),$(copy_app))

define copy_app
@test ! -d $(call quoted,$(APP)) || { echo foc33: $(call quoted,$(APP)) is a folder, APP: name the C file in it >&2; exit 2; }
@test -f $(call quoted,$(APP)) || { echo foc33: no file $(call quoted,$(APP)), APP: name a C file, or one of $(apps) >&2; exit 2; }
@mkdir -p $(@D); { printf '#line 1 "%s"\n' "$$(printf %s $(call quoted,$(APP)) | sed 's/[\\"]/\\&/g')"; cat $(call quoted,$(APP)); } >$@.new && \
    { cmp -s $@.new $@ && rm $@.new || mv $@.new $@; }
endef

app_shown = $(if $(filter $(app_copy),$(app_source)),$(APP),$(app_source))
# A unit of its own: its names are its own, and it links to what app.h has and to nothing else.
$B/app.from: FORCE
	$(call remember,$(app_source))

$B/app.o: $(app_source) $B/app.from $B/flags tools/make/app.sh | $B/params
	$(call say,cc,$(call quoted,$(app_shown)))tools/make/app.sh $@ $< $(call quoted,$(app_shown)) nm $(compile) -MMD -MP

$B/contents: FORCE
	$(call remember,$(firmware_objects) $(board_objects))

# Nothing is compiled with a userparams.h that cannot work.
params = @tools/make/userparams.sh $@
params_tools := $(addprefix tools/make/,userparams.sh userparams.awk nearest.awk literals.awk messages.awk)
$B/params: $B/flags $(params_source) $(params_tools)
	$(params) $(compile)

$(board_objects): private INCLUDES += $(board_includes)
$(board_objects): private CFLAGS += -O3

ifeq ($(own_way),)
board_compile = $(CC) $(CFLAGS) $(warnings) $(if $(WERROR),-Werror) -Itools/cpu_host -Iinclude -I. $(board_includes)

$(board_folder)/flags: FORCE
	$(call remember,$(board_compile))

# Two variants may do this at the same time.
$(board_folder)/%.o: %.c $(board_folder)/flags
	@mkdir -p $(@D)
	$(call say,cc,$<)$(board_compile) -MMD -MP -MF $@.$$$$.d -MT $@ -c $< -o $@.$$$$ && mv -f $@.$$$$.d $(@:.o=.d) && mv -f $@.$$$$ $@
endif

$B/%.o: %.c $B/flags | $B/params
	@mkdir -p $(@D)
	$(call say,cc,$<)$(compile) -MMD -MP -c $< -o $@

$B/unit.c: FORCE
	$(call remember_lines,$(call includes_of,$(filter-out %/main.c,$(firmware_sources)) tools/cpu_host/written.h))

# Control and drive as one unit, for tests with a mode or parameters of their own and for the image's probe.
$B/law.c: FORCE
	$(call remember_lines,$(call includes_of,$(filter firmware/control/% firmware/drive/%,$(firmware_sources))))

$(unit): $B/unit.c $B/flags | $B/params
	$(call say,cc,$<)$(compile) -MMD -MP -c $< -o $@

$B/libfirmware.a: $(firmware_objects) $B/contents
	@rm -f $@.new
	$(call say,ar,$@)ar rcs $@.new $(firmware_objects) && mv -f $@.new $@

$B/libparts.a: $(part_objects) $B/contents
	@rm -f $@.new
	$(call say,ar,$@)ar rcs $@.new $(part_objects) && mv -f $@.new $@

# The firmware without its loop, its variables in one stretch.
window_script := tools/cpu_host/window.ld
$B/firmware.o: $(unit) $B/app.o $B/contents $(window_script)
	$(call say,ld,$@)$(CC) -r -nostdlib -Wl,-T,$(window_script) -o $@.new $(unit) $B/app.o && mv -f $@.new $@

firmware_library := $(board_objects) $B/firmware.o $B/tools/cpu_host/xc.o
$B/libvboard.so: $(firmware_library)
	$(call say,ld,$@)$(CC) -shared $(if $(SAN),$(sanitizer),-Wl$(comma)--no-undefined) -o $@.new $^ -lm && mv -f $@.new $@

# What a client on the serial line reads names and addresses from.
$B/foc33.elf: $B/firmware.o tools/live/chip_types.py
	$(call say,ld,$@)$(CC) -nostdlib -static -no-pie -Wl,--section-start=fw_ram=0x800,-Ttext-segment=0x100000,-e,0,--unresolved-symbols=ignore-all \
	    -o $@.new $< && $(python) -m tools.live.chip_types $@.new && mv -f $@.new $@

# ---- tests: pytest runs the Python tests and the Unity executables, after make has built what they need ----------------------
c_tests = $(patsubst test/%.c,%,$(wildcard test/$1/test_*.c))
py_tests = $(patsubst test/%.py,%,$(wildcard test/$1/test_*.py))

unit_c := $(call c_tests,unit)
board_c := $(call c_tests,chip)
behaviour_c := $(call c_tests,behaviour)
source_py := $(call py_tests,unit) $(call py_tests,golden)
bench_py := $(call py_tests,tools) $(call py_tests,behaviour) $(call py_tests,fuzz)
tools_py := $(call py_tests,static) $(call py_tests,coverage)
modes := $(shell sed -n 's/^ *X.\([A-Z_]*\), .*/\1/p' include/drive/modes/mode_table.h)

# The longest first, so that none of them is left alone at the end. Quick is what the edit loop of firmware and bench needs: no tuner, no sweeps, no search for a parameter's ends.
slow_suites := $(filter $(addprefix tools/test_,any_motor spreadsheet tune_% fw_tune identify robust loadsteps sensitivity image_build examples progress recipes bench_pages userparams import live_% make_% campaign setup suites),$(bench_py))
# Have tests for a release alone, with every motor and every mode.
release_suites = tools/test_tune_remedies $(addprefix behaviour/test_,identify_motors identify_ranges low_speeds) tools/test_live_layout tools/test_live_loops $(if $(shell command -v $(xc16)gcc),image/test_modes)
longest := $(slow_suites) $(addprefix behaviour/test_,identify_motors fw_search)
quick_suites := $(filter-out golden/% unit/test_param_ranges,$(source_py)) $(filter-out $(slow_suites),$(filter tools/%,$(bench_py))) $(unit_c) $(board_c)
all_suites := $(filter-out tools/test_tune_remedies,$(tools_py) $(longest) $(filter-out $(longest),$(bench_py))) $(source_py) $(behaviour_c) $(unit_c) $(board_c)

# Every chosen suite runs anew. make leaves a stamp for each that it could build; one without has failed.
chosen = $(if $(ONLY),$(filter $(foreach name,$(ONLY),$(name) %/$(name)),$1),$1)
unknown_suites = $(strip $(foreach name,$(ONLY),$(if $(filter $(name) %/$(name),$1),,$(name))))
suite_files = $(foreach suite,$1,$(firstword $(wildcard test/$(suite).c test/$(suite).py)))
mode_stamps := $(addprefix $T/made/modes/,default $(modes))
stamps = $(addprefix $T/made/,$1) $(if $(filter static/test_modes,$1),$(mode_stamps))
run_suites = +@$(if $(call unknown_suites,$1),echo "foc33: no suite '$(call unknown_suites,$1)'$(comma) make $@: make test runs them all and shows their names" >&2; \
    exit 2;) mkdir -p $T; exec 9>$T/lock; flock -n 9 || { echo "waiting for another make test"; flock 9; }; \
    rm -rf $T/made $(if $2,$T/summary.json); ($(if $(suffix),$(shared)) $(lock) $(MAKE) -k $(call stamps,$(call chosen,$1))) || true; \
    PIL_LIBRARY=$B/libpil.so $(alone) $(python) -m pytest -qq -rN --capture=sys --tb=short --continue-on-collection-errors --basetemp=$T/tmp \
    --jobs $$(getconf _NPROCESSORS_ONLN) --build $T --made $T/made $2 $(call suite_files,$(call chosen,$1))

.PHONY: test test-quick test-release setup-test setup-checks
test: setup-test setup-checks ## [tests] every test but those for a release; the last line is "N passed, N failed" [ONLY="test_pi ..."]
	$(call run_suites,$(all_suites),$(if $(ONLY),,--summary $T/summary.json))

test-release: export PYTEST_ADDOPTS := -m release
test-release: setup-test ## [tests] every motor is identified and held at its lowest speed, every remedy that the tuner names is tried: before a release
	$(call run_suites,$(release_suites))

test-quick: setup-test ## [tests] the tests for the edit loop [ONLY="test_pi ..."]
	$(call run_suites,$(quick_suites))

# In one go and in sight; each check's own target looks again for what it alone needs.
browser := chromium=chromium chromedriver=chromium-driver module:selenium=python3-selenium npm=npm
axe_version := 4.10.3
axe := build/setup/axe-core-$(axe_version).js
setup-checks: setup-test
	@$(if $(ONLY),:,test/static/need.sh $(browser) cppcheck=cppcheck clang-14=clang-14 clang-tidy-14=clang-tidy-14 gcovr=gcovr \
	    soffice=libreoffice-calc-nogui)
	@$(if $(ONLY)$(wildcard $(axe)),:,tools/setup/axe.sh $(axe_version) $(axe))

# What the tests and the pictures of the page of make live need.
.PHONY: setup-browser
setup-browser: setup-test
	@test/static/need.sh $(browser)
	@$(if $(wildcard $(axe)),:,tools/setup/axe.sh $(axe_version) $(axe))

setup-test:
	@tools/setup/prepare.sh test
	$(if $(wildcard $(gem_stamp)),,$(call build,$(gem_stamp)))

# Unity and CMock are the copies that the ceedling gem carries.
ceedling := 1.2.1
gem_stamp := build/gems/ceedling-$(ceedling).stamp
unity := build/gems/gems/ceedling-$(ceedling)/vendor/unity
cmock := build/gems/gems/ceedling-$(ceedling)/vendor/cmock

.PHONY: gems
gems: setup-test

$(gem_stamp):
	@tools/setup/gems.sh $(ceedling) $@

# Golden vectors: text in test/golden/vectors, headers for the tests in build/golden.
golden_stamp := build/golden/stamp
$(golden_stamp): $(wildcard test/golden/vectors/*.txt) test/golden/to_c.py
	@$(python) test/golden/to_c.py --out $(@D) && touch $@

build/golden/golden_%.h: $(golden_stamp) ;

.PHONY: golden
golden: setup-run ## [upkeep] write the golden vectors from the reference model
	@$(python) test/golden/generate.py

# A test's own flags stand in its first lines: /* defines: -DTUNING */. They act on the test and its runner, not on the library.
own_defines = $$(sed -n '1,5s@.*/\* defines: \(.*\) \*/.*@\1@p' $1)
test_compile = $(CC) $(CFLAGS) $(INCLUDES) -Itest/unit/support $(board_includes) $(patsubst %/,-I%,$(wildcard include/*/)) -I$T/mocks -I$B -Ibuild/golden \
    -isystem $(unity)/src -isystem $(cmock)/src -DUNITY_INCLUDE_CONFIG_H $(DEFINES)

$T/flags: FORCE | $B/flags
	$(call remember,$(test_compile) -include)

$T/%_runner.c: test/%.c test/unit/support/cmock.yml | $(gem_stamp)
	@mkdir -p $(@D)
	$(quiet)$(RUBY) $(unity)/auto/generate_test_runner.rb test/unit/support/cmock.yml $< $@ >$@.log 2>&1 || { head -n 1 $@.log >&2; exit 1; }

# The test and its runner are one unit: what both include is read once.
$T/%.o: test/%.c $T/%_runner.c $T/flags | $B/params $B/law.c $(gem_stamp) $(golden_stamp)
	@mkdir -p $(@D)
	$(call say,cc,$<)$(test_compile) $(warnings) -Werror -Itest/$(*D) $(call own_defines,$<) $(if $(filter unit/test_identify_motor,$*),$(long_run)) -MMD -MP -include $< -c $T/$*_runner.c -o $@

$T/unity.o: $T/flags | $(gem_stamp)
	$(quiet)$(test_compile) -w -c $(unity)/src/unity.c -o $@

$T/cmock.o: $T/flags | $(gem_stamp)
	$(quiet)$(test_compile) -w -c $(cmock)/src/cmock.c -o $@

# A test that includes mock_x.h gets a mock of the x.h in whichever folder of include/ has it.
.SECONDEXPANSION:
$T/mocks/mock_%.c $T/mocks/mock_%.h: $$(wildcard include/*/$$*.h) test/unit/support/cmock.yml | $(gem_stamp)
	@mkdir -p $(@D)
	$(quiet)$(RUBY) $(cmock)/lib/cmock.rb -otest/unit/support/cmock.yml --mock_path=$(@D) $< >$(@D)/$*.log 2>&1 || \
	    { head -n 1 $(@D)/$*.log >&2; exit 1; }

$T/mocks/mock_%.o: $T/mocks/mock_%.c $T/flags
	$(quiet)$(test_compile) -w -MMD -MP -c $< -o $@

mock_uses := $(shell grep -HoE 'mock_[a-z0-9_]+\.h' $(wildcard test/*/test_*.c) /dev/null)
mocks_of = $(sort $(patsubst test/$1.c:%.h,$T/mocks/%.o,$(filter test/$1.c:%,$(mock_uses))))
define uses_mocks
$T/$1.o: | $(patsubst %.o,%.h,$(call mocks_of,$1))
$T/$1: $(call mocks_of,$1)
endef
$(foreach test,$(unit_c) $(board_c) $(behaviour_c),$(eval $(call uses_mocks,$(test))))

# The library comes last: what the test or a mock defines is then not taken from it. The board's own tests bring a small firmware
# of theirs instead, so the probe that looks into the real one stays out.
c_executables := $(addprefix $T/,$(unit_c) $(board_c) $(behaviour_c))
$(c_executables): %: %.o $T/unity.o $T/cmock.o
	$(quiet)$(CC) $(sanitizer) -o $@ $(filter %.o,$^) $(filter %.a,$^) -lm
$(addprefix $T/,$(unit_c)): $B/libparts.a
$(addprefix $T/,$(board_c)): $(filter-out $(probe),$(board_objects)) $B/tools/cpu_host/xc.o
own_files := $(patsubst test/%.c,%,$(shell grep -l '"firmware/' $(behaviour_c:%=test/%.c) /dev/null))
$(addprefix $T/,$(filter-out $(own_files),$(behaviour_c))): $(board_objects) $B/libfirmware.a
$(addprefix $T/,$(own_files)): $(board_objects) $B/libparts.a

$T/made/%:
	@mkdir -p $(@D) && touch $@

$(addprefix $T/made/,$(unit_c) $(board_c) $(behaviour_c)): $T/made/%: $T/%
$(addprefix $T/made/,$(bench_py)): $B/libvboard.so

$(mode_stamps): $T/made/modes/%:
	@+$(MAKE) -s WERROR=1 SAN= VARIANT=warnings-$* DEFINES=$(if $(filter-out default,$*),-D$*) $(call libraries,build/host-warnings-$*)
	@mkdir -p $(@D) && touch $@

# Further checks, each with its own rules; they may add suites to all_suites.
include $(part_makefiles)

# ---- checks and cleaning -------------------------------------------------------------------------------------------------
.PHONY: warnings sanitize clean
warnings: ## [tests] compile every mode with warnings as errors
	@+$(lock) for mode in "" $(modes:%=-D%); do folder=warnings-"$${mode:-default}"; \
	    $(MAKE) WERROR=1 SAN= VARIANT="$$folder" DEFINES="$$mode" $(call libraries,"build/host-$$folder") || exit 1; done

sanitize: setup-run ## [tests] the demo under -fsanitize=undefined,address [SCENARIO=demo DEFINES= USERPARAMS= OUT=]
	@library=$$($(front_end) prepare $(scenario) $(what) --sanitized) || exit; \
	LD_PRELOAD="$$($(CC) -print-file-name=libasan.so) $$($(CC) -print-file-name=libubsan.so)" \
	    ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 \
	    $(front_end) run $(scenario) --library "$$library" --no-plots $(out)

clean: ## [upkeep] remove what was built and run; build/gems and build/setup stay
	@rm -rf build/board* build/host* build/test* build/target* build/size build/golden build/run build/tuner build/pycache

-include $B/params.d $(firmware_objects:.o=.d) $(part_objects:.o=.d) $(board_objects:.o=.d) $(c_executables:%=%.d)
