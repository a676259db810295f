# What in userparams.h cannot be meant: a name that is defined twice with two values or is close to a missing one, a constant of AN1292's header, a
# number that ends in a semicolon.
#
#   awk -v places=FILE -v least=FILE -v refused=FILE -v near=FILE -f tools/make/nearest.awk -f tools/make/userparams.awk KNOWN DEFINED
#
# KNOWN: the rows of the tables of parameters and modes, with @ between the cells; DEFINED: userparams.h as gcc -E -dD shows it, with line
# markers. To the files go: where each parameter stands (name, file:line, range, with tabs between them); the least value of each (name, value);
# the names that are refused; the missing names that they may stand for.

function refuse(name, what) {
    print "foc33: " what
    print name >>refused
}

# The number to write for AN1292's "Q15(0.25);".
function plain(text) {
    sub(/[ \t]*;[ \t;]*$/, "", text)
    if (text ~ /^(Q15|NORM_CURRENT)[ \t]*\([^()]*\)$/) {
        sub(/^[^(]*\([ \t]*/, "", text)
        sub(/[ \t]*\)$/, "", text)
    }
    return text
}

# Names a constant that AN1292's header sets and that follows from another number here.
function an1292(   count, word, i, name) {
    count = split(constants, word, " ")
    for (i = 1; i < count; i += 2) {
        name = word[i]
        if (name in value && place[name] != option) {
            refuse(name, place[name] ": " name " = " value[name] " is a constant of AN1292\47s header, here it follows from " word[i + 1] \
                   ": remove it; of a whole header of AN1292\47s `make import HEADER=file` makes a motor file and a userparams.h")
            return 1
        }
    }
    return 0
}

BEGIN {
    option = "DEFINES or the scenario"
    constants = "NORM_RS MOTOR_RS_OHM NORM_LSDTBASE MOTOR_LS_MH NORM_INVKFIBASE MOTOR_KPHI_V_PER_KRPM NORM_DELTAT LOOPTIME_SEC " \
        "SPEEDREFRAMP SPEEDREFRAMP_RPM_PER_S D_ILIMIT_HS MAXIMUM_SPEED_RPM D_ILIMIT_LS NOMINAL_SPEED_RPM"
}
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
        refuse(name, here ": " name (text == "" ? "" : " = " text) " is the second definition, the first stands in " place[name] \
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
        if (cell[i] ~ /parameter/) {
            split(cell[i + 2], ends, " ")
            print cell[i + 1] "\t" ends[1] >least
        }
    }
    if (an1292()) exit 1
    gsub(/[^A-Za-z0-9_]+/, " ", used)
    used = " " used " "
    for (word in known)
        if (!(word in value)) missing = missing " " word
    for (name in value) {
        if (name in known) {
            print name "\t" place[name] "\t" known[name] >places
            if (value[name] ~ /;[ \t]*$/)
                refuse(name, place[name] ": " name " = " value[name] " ends in a semicolon: write " plain(value[name]))
        }
        else if (place[name] != option && !index(used, " " name " ")) { # what another macro uses is the user's own
            meant = nearest(name, missing, 0.83)
            if (meant == "") continue
            refuse(meant, place[name] ": " name " is no parameter: did you mean " meant (known[meant] == "" ? "" : ", " known[meant]) "?")
            print meant >>near
        }
    }
}
