# Numbers inside the values of userparams.h that C does not read as people do, as a C file that refuses them when it is compiled.
#
#   awk -v refused=FILE -v as_read=FILE -f literals.awk <VALUES >FILE.c
#
# VALUES: a line with the quoted name and the value each, macros of the user's own replaced; FILE: the names that are refused already. To `as_read` go
# the values as people read them (name, value), of what may be refused. An octal number (05500) is refused wherever it stands. A quotient is compared with that
# of the same numbers with a decimal point: 5/2 is 2 to C, 20/10 is no mistake.

function is_number(token) { return token ~ /^\.?[0-9]/ }
function is_whole(token) { return token ~ /^[0-9]+[uUlL]*$/ }

# The value with a decimal point in each whole number; sets `octal` to a number that begins with 0.
function pointed(text,   result, token) {
    octal = ""
    while (match(text, /\.?[0-9]([eE][-+]|[0-9A-Za-z_.])*|[A-Za-z_][A-Za-z0-9_]*/)) {
        token = substr(text, RSTART, RLENGTH)
        result = result substr(text, 1, RSTART - 1)
        text = substr(text, RSTART + RLENGTH)
        if (token ~ /^0[0-9]+[uUlL]*$/) {
            octal = token
            sub(/^0+/, "", token)
        }
        if (is_number(token) && is_whole(token)) {
            sub(/[uUlL]+$/, "", token)
            token = token ".0"
        }
        result = result token
    }
    return result text
}

function refuse(kind, condition, message) {
    gsub(/["\\]/, "\\\\&", message)
    print name "\t" floating >as_read
    print "PARAM_CHECK(range_of_" name ") { if (" condition ") PARAM_REFUSE(" kind "_" name ", \"" message "\") }"
}

BEGIN {
    while ((getline line < refused) > 0) told[line] = 1
    print "#include \"drive/param_limits.h\"\n#include \"drive/param_scaling.h\""
}
/^"/ {
    name = $1
    gsub(/"/, "", name)
    text = substr($0, length($1) + 2)
    if (name in told) next
    floating = pointed(text)
    if (octal != "")
        refuse("octal", "1", name " = " text " has an octal number, " octal ": write it without the 0 in front")
    else if (text ~ /\// && floating != text && text !~ /[%&|^~<>?!"']/ && text !~ /\/[ \t(]*0+(\.0*)?[fF]?[ \t)]*$/ && text !~ /NORM_/) # what has a quotient, no division by 0 (param_check.c tells of it), and operators that a float has
        refuse("fraction", "__builtin_fabsf((float)(" text ") - (float)(" floating ")) > 0.00001F * __builtin_fabsf((float)(" floating "))", \
               name " = " text " divides whole numbers, of which C drops the fraction: write " floating)
    else if (text !~ /^[-+]?[0-9.]+$/) # what is no C at all has the compiler's words beside its name
        print "PARAM_CHECK(range_of_" name ") { (void)((float)(" name ")); }"
}
