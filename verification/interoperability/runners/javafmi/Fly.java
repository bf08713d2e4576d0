import java.io.IOException;
import java.io.PrintWriter;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import org.javafmi.proxy.Status;
import org.javafmi.proxy.v2.State;
import org.javafmi.wrapper.Simulation;
import org.javafmi.wrapper.v2.Access;

/** JavaFMI, Co-Simulation: variables by name, the state saved and restored on the way. */
public class Fly {
    public static void main(String[] arguments) throws Exception {
        List<String> outputs = Files.readAllLines(Path.of("outputs.txt"));
        List<String> rows = Files.readAllLines(Path.of("manoeuvre.csv"));
        String[] names = rows.get(0).split(",");
        int detour = names.length - 1;
        Simulation rov = new Simulation("rov.fmu");
        Access access = new Access(rov);
        write("parameters.csv", rov);
        check(rov.init(0.0));
        try (PrintWriter result = new PrintWriter("result.csv")) {
            result.println("time," + String.join(",", outputs));
            print(result, 0.0, rov, outputs);
            for (int n = 1; n + 1 < rows.size(); n++) {
                String[] row = rows.get(n).split(",");
                double end = Double.parseDouble(rows.get(n + 1).split(",")[0]);
                if (row[detour].equals("1")) {
                    State state = access.getState(State.newEmptyState());
                    write("detour.csv", rov);
                    check(access.doStep(rov.getCurrentTime(), 1.0));
                    check(access.setState(state));
                    access.freeState(state);
                }
                for (int i = 1; i < detour; i++) {
                    rov.write(names[i]).with(Double.parseDouble(row[i]));
                }
                check(rov.doStep(0.1));
                print(result, end, rov, outputs);
            }
        }
        rov.terminate();
    }

    static void write(String file, Simulation rov) throws IOException {
        for (String line : Files.readAllLines(Path.of(file)).stream().skip(1).toList()) {
            String[] pair = line.split(",");
            rov.write(pair[0]).with(Double.parseDouble(pair[1]));
        }
    }

    static void print(PrintWriter result, double time, Simulation rov, List<String> outputs) {
        result.print(time);
        for (String name : outputs) {
            result.print("," + rov.read(name).asDouble());
        }
        result.println();
    }

    static void check(Status status) {
        if (status != Status.OK) {
            throw new IllegalStateException("the FMU answered " + status);
        }
    }
}
