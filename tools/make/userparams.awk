# Names in userparams.h that cannot be meant: defined twice with two values, or close to a name that is missing.
#
#   awk -v places=FILE -f tools/make/nearest.awk -f tools/make/userparams.awk KNOWN DEFINED
#
# KNOWN: the rows of the tables of parameters and modes, with @ between the cells; DEFINED: userparams.h as gcc -E -dD shows it, with line
# markers. To FILE goes where each parameter stands: name, file:line, range, with tabs between them.

function refuse(what) {
    print "foc33: " what
    wrong = 1
}

BEGIN { option = "DEFINES or the scenario" }
FNR == NR {
    rows = rows $0
    next
}
/^# [0-9]+ "/ {
    line = $2 - 1
    file = $0
    sub(/^# [0-9]+ "/, "", file)
    by_option = file ~ /^<command/
    counts = by_option || (file !~ /^</ && file !~ /" .*3/) # 3: a header of the compiler
    sub(/".*/, "", file)
    sub(/^\.\//, "", file)
    next
}
{ line++ }
$1 == "#undef" { delete value[$2] }
$1 == "#define" && counts {
    name = $2
    sub(/\(.*/, "", name)
    text = substr($0, length("#define " name) + 2)
    here = by_option ? option : file ":" line
    if (name in value && value[name] != text)
        refuse(here ": " name (text == "" ? "" : " = " text) " is the second definition, the first stands in " place[name] \
               ": keep one of the two")
    value[name] = text
    place[name] = here
    used = used " " text
}

END {
    count = split(rows, cell, "@")
    for (i = 2; i + 2 <= count; i += 4) {
        gsub(/[" ]/, "", cell[i + 1])
        gsub(/"/, "", cell[i + 2])
        known[cell[i + 1]] = cell[i + 2]
    }
    gsub(/[^A-Za-z0-9_]+/, " ", used)
    used = " " used " "
    for (word in known)
        if (!(word in value)) missing = missing " " word
    for (name in value) {
        if (name in known)
            print name "\t" place[name] "\t" known[name] >places
        else if (place[name] != option && !index(used, " " name " ")) { # what another macro uses is the user's own
            near = nearest(name, missing, 0.83)
            if (near != "")
                refuse(place[name] ": " name " is no parameter: did you mean " near (known[near] == "" ? "" : ", " known[near]) "?")
        }
    }
    exit wrong
}
