# foc33: firmware, virtual board, tests. `make` alone prints the targets.
VARIANT ?=
DEFINES ?=
USERPARAMS ?= .
CC = gcc
B := build/host$(if $(VARIANT),-$(VARIANT))
CFLAGS = -std=gnu99 -O2 -g -fPIC -Wall -Wextra -Wconversion -Wshadow -ftrack-macro-expansion=0 -MMD -MP
INC = -I$(USERPARAMS) -Itools/host -Iinclude -I.
FW := $(wildcard firmware/*/*.c) tools/host/xc.c
BOARD := $(wildcard tools/board/*.c)
FWO := $(FW:%.c=$B/%.o)
BO := $(BOARD:%.c=$B/%.o)
lib: $B/libfirmware.a
vboard: $B/libvboard.so
$B/libfirmware.a: $(FWO)
	ar rcs $@ $^
$B/libvboard.so: $(BO) $(filter-out %/main.o,$(FWO))
	$(CC) -shared -o $@ $^ -lm
$B/%.o: %.c
	@mkdir -p $(@D)
	$(CC) $(CFLAGS) $(INC) $(DEFINES) -c $< -o $@
-include $(FWO:.o=.d) $(BO:.o=.d)
