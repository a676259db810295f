# Reads the list of targets in the makefiles and says in one line what is wrong with the variables on make's command line: a name that
# nothing reads, or one that none of the goals reads. Says nothing if all is well.
#
#   awk -v typed="MOTER OUT" -v goals="run" -f nearest.awk -f input.awk Makefile tools/make/*.mk
#
# What a target reads is in the brackets of its line in the list. Beside that:
BEGIN {
    names("V INSTALL FOC33_QUIET CC PYTHON RUBY SHELL MAKE MAKEFLAGS GNUMAKEFLAGS XC16 DFP", everywhere)
    names("lib vboard bench iss examples test test-quick test-release test-target firmware flash size", compiles)
    names("VARIANT SAN DEFINES USERPARAMS APP WERROR OPT CFLAGS warnings sanitizer", compilation)
}

/^[a-z0-9-]+:.*## \[/ {
    goal = substr($0, 1, index($0, ":") - 1)
    listed[goal] = 1
    rest = $0
    while (match(rest, /[A-Z][A-Z0-9]*=/)) { # only the brackets have such words
        name = substr(rest, RSTART, RLENGTH - 1)
        known[name] = reads[goal, name] = 1
        takes[goal] = takes[goal] " " name
        rest = substr(rest, RSTART + RLENGTH)
    }
}

END {
    for (name in everywhere) known[name] = 1
    for (name in compilation) known[name] = 1
    goal_count = split(goals, goal_list, " ")
    typed_count = split(typed, typed_list, " ")
    for (i = 1; i <= typed_count; i++) {
        name = typed_list[i]
        if (!(name in known)) {
            near = nearest(name, all(), 0)
            print "foc33: no variable " name ", make's command line: " (near == "" ? "`make` lists them" : "did you mean " near "?")
            exit 1
        }
        if (!(name in everywhere) && !read_by_a_goal(name)) {
            goal = goal_list[1]
            print "foc33: make " goal " has no " name ", make's command line: " \
                (takes[goal] == "" ? "leave it out" : "it takes" takes[goal])
            exit 1
        }
    }
}

function names(text, set,   count, list, i) {
    count = split(text, list, " ")
    for (i = 1; i <= count; i++) set[list[i]] = 1
}

function read_by_a_goal(name,   i) {
    for (i = 1; i <= goal_count; i++)
        if (!(goal_list[i] in listed) || (goal_list[i], name) in reads || goal_list[i] in compiles && name in compilation) return 1
    return 0
}

function all(   name, text) {
    for (name in known) text = text " " name
    return text
}
