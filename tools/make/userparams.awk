# What in userparams.h cannot be meant: a name that is defined twice with two values or is close to a missing one, a constant of AN1292's header, a
# number that ends in a semicolon, a value that comes back to itself.
#
#   awk -v places=FILE -v least=FILE -v optional=FILE -v refused=FILE -v near=FILE -v foreign=FILE \
#       -f tools/make/nearest.awk -f tools/make/userparams.awk KNOWN DEFINED
#
# KNOWN: the rows of the tables of parameters and modes, with @ between the cells; DEFINED: userparams.h as gcc -E -dD shows it, with line
# markers. To the files go: where each parameter stands (name, file:line, range, with tabs between them); the least value of each (name, value); the
# optional ones and modes that have a value; the names that are refused; the missing names that they may stand for; values with a word that the
# header does not define (name, message).

function refuse(name, what) {
    print "foc33: " what
    print name >>refused
}

# The number to write for AN1292's "Q15(0.25);": without Q15() unless it is one of Q15 here, too.
function plain(text, range) {
    sub(/[ \t]*;[ \t;]*$/, "", text)
    if (range !~ /Q15/ && text ~ /^(Q15|NORM_CURRENT)[ \t]*\([^()]*\)$/) {
        sub(/^[^(]*\([ \t]*/, "", text)
        sub(/[ \t]*\)$/, "", text)
    }
    return text
}

# Names the constants that AN1292's header sets and that follow from other numbers here. Whether it is a whole header of AN1292: one line is enough then.
function an1292(   count, word, i, name, whole, lacks) {
    for (name in ranged) lacks += name in value ? -1 : 1
    whole = lacks > 0
    count = split(constants, word, " ")
    for (i = 1; i < count; i += 2) {
        name = word[i]
        follows[name] = 1
        if (name in value && place[name] != option) {
            refuse(name, place[name] ": " name " = " value[name] " is a constant of AN1292\47s header, here it follows from " word[i + 1] \
                   ": remove it; of a whole header of AN1292\47s `make import HEADER=file` makes a motor file and a userparams.h")
            if (whole) return 1
        }
    }
    return 0
}

# The first word of a value, and of what it uses, that leads nowhere: one that nothing defines, a parameter that is missing, or the name itself.
function stray(name, path,   text, word, count, words, i, found) {
    text = value[name]
    gsub(/\/\*[^*]*\*\/|"[^"]*"|\47[^\47]*\47/, " ", text)
    gsub(/[^A-Za-z0-9_.]+/, " ", text)
    count = split(text, words, " ")
    for (i = 1; i <= count; i++) {
        word = words[i]
        if (word ~ /^[0-9.]/) continue
        if (index(path, " " word " ")) return word
        if (word in value && !index(arguments[name], " " word " ")) found = stray(word, path word " ")
        else if (!(word in theirs) && !index(arguments[name], " " word " ") && !(word ~ /^(u?int[0-9]+_t|__.*)$/) \
                 && !(word in known && !(word in ranged)) && !(word == "NORM_INVKFIBASE" && path ~ /^ INVKFI_/)) found = word
        if (found != "") return found
    }
    return ""
}

# Tells of values whose words lead nowhere. What uses a missing parameter says nothing of its own.
function tell_stray(name,   word, meant, all) {
    word = stray(name, " " name " ")
    if (word == "") return
    if (word in value) {
        refuse(name, place[name] ": " name " = " value[name] " comes back to " word " itself: write a number, " known[name])
        return
    }
    if (word in ranged) {
        print name >>refused
        return
    }
    for (all in value) if (all in ranged) meant = meant " " all
    meant = word in follows ? "" : nearest(word, meant, 0.83)
    print name "\t" place[name] ": " name " = " value[name] \
        (word in follows ? " uses " word ", which follows from the parameters" : " uses " word ", which nothing defines") \
        (meant != "" ? ": did you mean " meant "?" : ": write a number, " known[name]) >>foreign
}

BEGIN {
    split("Q15 NORM_CURRENT float double int long short unsigned signed char const sizeof defined", words, " ")
    for (i in words) theirs[words[i]] = 1
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
$1 == "#define" && !counts {
    sub(/\(.*/, "", $2)
    theirs[$2] = 1
    next
}
$1 !~ /^#/ { # what is code: a constant of an enum
    gsub(/[^A-Za-z0-9_]+/, " ")
    for (i = 1; i <= NF; i++) theirs[$i] = 1
}
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
    arguments[name] = match($0, /^#define [A-Za-z0-9_]+\([^)]*\)/) ? substr($0, 1, RLENGTH) " " : ""
    gsub(/[^A-Za-z0-9_]+/, " ", arguments[name])
    used = used " " text
}

END {
    count = split(rows, cell, "@")
    for (i = 2; i + 2 <= count; i += 4) {
        gsub(/[" ]/, "", cell[i + 1])
        gsub(/"/, "", cell[i + 2])
        known[cell[i + 1]] = cell[i + 2]
        if (cell[i] ~ /parameter/) {
            ranged[cell[i + 1]] = 1
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
                refuse(name, place[name] ": " name " = " value[name] " ends in a semicolon: write " plain(value[name], known[name]))
            else if (name in ranged) tell_stray(name)
            else if (value[name] != "") print name >>optional
        }
        else if (place[name] != option && !index(used, " " name " ")) { # what another macro uses is the user's own
            meant = nearest(name, missing, 0.83)
            if (meant == "") continue
            refuse(meant, place[name] ": " name " is no parameter: did you mean " meant (known[meant] == "" ? "" : ", " known[meant]) "?")
            print meant >>near
        }
    }
}
