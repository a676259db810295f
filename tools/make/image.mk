# The image for the dsPIC33FJ32MC204, built by XC16: make firmware, flash, project. Uses the variables of the main Makefile.
#
# Variables: OPT (-O2, the best of the free licence; -O1, -O3), XC16 (folder of the compiler, XC16 or XC-DSC, if it is not on PATH), DFP (device pack, if the
# compiler has no support files for the part), DEFINES USERPARAMS VARIANT as for the PC, TOOL IPE (make flash).

OPT ?= -O2
# XC16, or its successor XC-DSC: its programs have other names, and it need not call itself __XC16__.
xc16_in = $(shell for name in xc16- xc-dsc-; do command -v $(call quoted,$1)$${name}gcc >/dev/null && echo $$name && break; done)
# XC16=.../bin and XC16=.../bin/xc16-gcc are the same compiler.
ifneq ($(filter %xc16-gcc %xc-dsc-gcc,$(XC16)),)
override XC16 := $(shell dirname $(call quoted,$(XC16)))
endif
ifeq ($(if $(XC16),$(call xc16_in,$(XC16)/bin/),on PATH),)
ifneq ($(call xc16_in,$(XC16)/),)
override XC16 := $(XC16)/..
endif
endif
xc_names := $(or $(call xc16_in,$(if $(XC16),$(XC16)/bin/)),xc16-)
xc16 = $(if $(XC16),$(call quoted,$(XC16)/bin/$(xc_names)),$(xc_names))
target_device := 33FJ32MC204

target_opt_suffix := $(subst $() ,,$(filter-out -O2,$(OPT)))
X := build/target$(target_opt_suffix)$(if $(VARIANT),-$(VARIANT))

# -fno-reorder-blocks, -fno-gcse, -fno-tree-pre and -fno-tree-ter: a tenth less flash at the same cycles. What several call is inline where it says so,
# or is tiny: another 800 bytes; tinier still where parameters are no constants, or they could not be kept beside the scope. At -O1 what is constant must be
# known to functions, or the image does not fit the chip. -fno-jump-tables: the longest path can be known.
target_in_ram = $(findstring PARAMS_IN_RAM,$(DEFINES) $(shell grep '^ *$(hash) *define  *PARAMS_IN_RAM' $(call quoted,$(or $(USERPARAMS),.)/userparams.h) 2>/dev/null))
target_tiny = --param=max-inline-insns-auto=$(if $(target_in_ram),7 -fno-tree-copy-prop,16)
target_inline = $(if $(filter -O2,$(OPT)),-fno-early-inlining -fno-ipa-sra -fno-tree-ch $(target_tiny),-fipa-cp)
target_flags = -std=gnu99 $(OPT) -g -fno-reorder-blocks -fno-gcse -fno-tree-pre -fno-tree-ter -fno-jump-tables $(target_inline) -ffunction-sections
target_whole := -fwhole-program
target_includes = $(if $(USERPARAMS),-I$X/header -I$(call quoted,$(USERPARAMS))) -Iinclude -I.
# All that XC16's compiler knows and -Wall -Wextra leave out.
target_warnings := -Wall -Wextra -Werror -pedantic -Wconversion -Wsign-conversion -Wshadow -Wundef -Wpointer-arith -Wcast-qual -Wcast-align \
    -Wstrict-prototypes -Wmissing-prototypes -Wredundant-decls -Wswitch-enum -Wswitch-default -Wfloat-equal -Wdouble-promotion -Wlogical-op \
    -Wvla -Winline -Wtype-limits -Wframe-larger-than=128
target_part = -mcpu=$(target_device) -omf=elf $(if $(DFP),-mdfp=$(call quoted,$(DFP)/xc16)) $(if $(filter xc-dsc-,$(xc_names)),-U__XC16__ -D__XC16__)
target_compile = $(xc16)gcc $(target_part) $(target_flags) $(target_warnings) $(target_includes) $(DEFINES) $(app_wishes)
target_link_options := --gc-sections,--report-mem
target_link = $(xc16)gcc $(target_part) -T p$(target_device).gld

target_unit = $(call includes_of,$(firmware_sources))

# As for a larger chip: says by how much an image does not fit this one, or with MEASURE=1 what it takes.
target_script = $(firstword $(wildcard $(if $(DFP),$(DFP)/xc16/support/dsPIC33F/gld/p$(target_device).gld) $(dir $(shell command -v $(xc16)gcc))../support/dsPIC33F/gld/p$(target_device).gld))
overfull = tools/make/overfull.sh $(call quoted,$(target_script)) $X/wide $X/options $(subst -T p$(target_device).gld,,$(target_link)) $X/image.o $X/app.o -Wl,$(target_link_options)

.PHONY: firmware image image-room options flash project find-xc16
firmware: find-xc16 ## [your board] the image for the dsPIC by XC16: build/target/foc33.hex [OPT=-O2 XC16=folder DEFINES= USERPARAMS= APP=name]
	$(call build,$X/checked)
	@cat $X/checked

image: find-xc16
	$(call build,$X/foc33.elf)

image-room: find-xc16
	$(call build,-s $X/image.o $X/app.o)
	@MEASURE=1 $(overfull)

options: setup-run find-xc16 ## [your board] what each option of userparams.h costs in flash and RAM [XC16=folder]
	@$(python) -m tools.image.options

find-xc16:
	@command -v $(xc16)gcc >/dev/null || { \
	    echo "foc33: no xc16-gcc," $(call quoted,$(if $(XC16),XC16=$(XC16) has no bin/xc16-gcc,not on PATH)): install \
	        "Microchip's MPLAB XC16 compiler or its successor XC-DSC (the free licence will do; XC compilers page at microchip.com)" \
	        "and name its folder, e.g. XC16=/opt/microchip/xc16/v2.10" >&2; exit 2; }

# What the compiler would answer with lines of its own about every file.
.PHONY: target-input
target-input: find-xc16
	$(call known_defines)
	$(no_parameters)
	@case $(call quoted,$(OPT)) in -O[123]) ;; *) \
	    echo foc33: no such level, $(call quoted,OPT=$(OPT)): use -O1, -O2 or -O3 >&2; exit 2;; esac
	@test -z $(call quoted,$(DFP)) || test -f $(call quoted,$(DFP)/xc16/bin/c30_device.info) || { \
	    echo foc33: no device pack for XC16, $(call quoted,DFP=$(DFP)): name the folder that has xc16/bin/c30_device.info >&2; exit 2; }

# Python with what reads ELF and HEX.
target_setup = @tools/setup/prepare.sh target

ifneq ($(USERPARAMS),)
$X/header/userparams.h: FORCE | target-input
	$(copy_header)
endif

$X/flags: FORCE $(if $(USERPARAMS),$X/header/userparams.h) | target-input
	$(need_header)
	$(call remember,$(target_compile) $(target_link_options))

$X/image.c: FORCE | target-input
	@mkdir -p $(@D); printf '%s\n' $(target_unit) | cmp -s - $@ || printf '%s\n' $(target_unit) >$@

$X/params: $X/flags $(params_source) $(params_tools)
	$(params) $(target_compile)

$X/app.from: FORCE | target-input
	$(call remember,$(app_source))

$X/app.o: $(app_source) $X/app.from $X/flags tools/make/app.sh | $X/params
	$(call say,xc16,$(call quoted,$(app_shown)))tools/make/app.sh $@ $< $(call quoted,$(app_shown)) $(xc16)nm $(target_compile) -MMD -MP

$X/image.o: $X/image.c $X/flags | $X/params
	$(call say,xc16,$<)$(target_compile) $(target_whole) -MMD -MP -c $< -o $@

# Each file on its own, for the unit tests on the target (tools/make/test-target.mk).
$X/%.o: %.c $X/flags | $X/params
	@mkdir -p $(@D)
	$(call say,xc16,$<)$(target_compile) -MMD -MP -c $< -o $@

$X/foc33.elf: $X/image.o $X/app.o tools/image/crc.py
	$(call say,ld,$@)$(target_link) -o $@ $(filter %.o,$^) -Wl,-Map=$X/foc33.map,$(target_link_options) >$X/foc33.memory 2>&1 || \
	    { printf '%s\n' $(call quoted,$(DEFINES)) | cat - $(call quoted,$(or $(USERPARAMS),.)/userparams.h) >$X/options; \
	    ! grep -q 'Could not allocate\|is full' $X/foc33.memory || ! $(overfull) >&2 || { rm -f $@; exit 1; }; reason=$$(grep -iEm 1 'undefined reference|error|could not|cannot|is full|multiple definition' $X/foc33.memory); \
	    echo "foc33: the image does not link: $${reason#: } (more in $X/foc33.memory)" >&2; rm -f $@; exit 1; }
	@! grep -i warning $X/foc33.memory >&2 || { rm -f $@; exit 1; }
	$(target_setup)
	@$(python) -m tools.image.crc $@ || { rm -f $@; exit 1; }

$X/foc33.hex: $X/foc33.elf
	$(quiet)$(xc16)bin2hex $< -a -omf=elf $(if $(DFP),-mdfp=$(call quoted,$(DFP)/xc16)) >$X/foc33.bin2hex 2>&1 || \
	    { cat $X/foc33.bin2hex >&2; rm -f $@; exit 1; }

# Another mode has its own tables and arrays, another level more code, another header its own motor, another application its own size: the budget is for the drive as it is delivered.
target_modes = $(DEFINES)$(filter $(modes),$(shell sed -n 's/^ *# *define *\([A-Z_]*\).*/\1/p' $(call quoted,$(or $(USERPARAMS),.)/userparams.h) 2>/dev/null))
target_header = $(shell cat $(call quoted,$(or $(USERPARAMS),.)/userparams.h) 2>/dev/null | cksum | cut -d ' ' -f 1)
target_other = $(target_modes)$(filter-out -O2,$(OPT))$(if $(filter $(target_header),$(shell sed -n 's/^header_cksum = \([0-9]*\).*/\1/p' firmware/budget.toml)),,header)$(filter-out panel,$(APP))
target_budget = $(if $(target_modes)$(filter-out -O2,$(OPT)),,--budget firmware/budget.toml $(if $(target_other),--other-header))
target_check = $(python) -m tools.image.image $X/foc33.elf $X/foc33.hex --map $X/foc33.map --objdump $(call quoted,$(xc16)objdump) $(target_budget) $(if $(filter -O2,$(OPT)),--wcet)

$X/checked: $X/foc33.hex firmware/board/main.c firmware/budget.toml $(wildcard tools/image/*.py)
	$(target_setup)
	$(call build,-s build/iss/libmachine.so)
	@$(target_check) >$@.new || { status=$$?; cat $@.new; rm -f $@.new $@; mv -f $X/foc33.hex $X/foc33.refused.hex; exit $$status; }
	@mv $@.new $@

flash: firmware ## [your board] program the board by MPLAB IPE's command line, or say how [TOOL=PK4|PK5|ICD4|SNAP|PK3 IPE=folder]
	@$(python) -m tools.image.flash $X/foc33.hex --elf $X/foc33.elf $(if $(TOOL),--tool $(call quoted,$(TOOL))) $(if $(IPE),--ipe $(call quoted,$(IPE)))

# What the MPLAB X project is made of, one item a line: it cannot say anything else than this file does.
target_facts = $(foreach word,$(filter %.c,$(params_source)),'first $(word)') $(foreach word,$(firmware_sources),'unit $(word)') 'app firmware/app/panel.c' $(foreach word,$(wildcard include/*.h include/*/*.h include/*/*/*.h) userparams.h,'header $(word)') \
    $(foreach word,$(filter-out -Werror,$(target_flags) $(target_whole) $(target_warnings)),'flag $(word)') \
    $(foreach word,$(patsubst -I%,%,$(target_includes)),'include $(word)') \
    $(foreach word,$(subst $(comma), ,$(target_link_options)),'link $(word)') 'device $(target_device)'

# For everybody the same, whatever this build is asked for.
project project-facts: override OPT := -O2
project project-facts: override USERPARAMS :=

project: ## [your board] write the MPLAB X project firmware.X
	$(target_setup)
	@printf '%s\n' $(target_facts) | $(python) -m tools.image.project

.PHONY: project-facts
project-facts:
	@printf '%s\n' $(target_facts)

-include $X/params.d $X/image.d $X/app.d $(firmware_sources:%.c=$X/%.d)
